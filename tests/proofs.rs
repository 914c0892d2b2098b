//! Proofs about the firmware's images: worst stack, size, instructions of the tasks, jitter of the
//! interrupts.

use image::Image;
use image::memory::Map;
use image::stack::Stack;
use pil::instructions::{Instructions, median, most};
use pil::manoeuvre::{self, Manoeuvre};
use pil::mil_sil_pil::{Target, on_processor};
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use qemu::Machine;
use qemu::session::LinkKind;
use shared_model::dither::{Application, Waveform};
use shared_model::friction::FrictionLaw;
use shared_model::tire::TireModel;
use shared_model::vehicle::SlipForm;
use sim_host::firmware::PRIORITIES;
use std::fs;
use tests::golden::{Figure, check_figures};
use tests::{TIME_OUT, board_image, image, record, root, scenario};

const BOARDS: [&str; 4] = ["mps2", "netduinoplus2", "nrf52840dk", "nucleog474re"];
/// Boards with a CAN.
const CAN_BOARDS: [&str; 2] = ["netduinoplus2", "nucleog474re"];
const IMAGES: [&str; 2] = ["ecu", "bench"];
/// Memory that the ECU's program may use on any board, bytes: limits of this project, far below
/// what the boards have.
const STACK_LIMIT_BYTES: u32 = 16 * 1024;
const FLASH_LIMIT_BYTES: u32 = 128 * 1024;
const RAM_LIMIT_BYTES: u32 = 64 * 1024;
/// Spread of the time between PWM interrupts, counts of 40 ns.
const JITTER_LIMIT_COUNTS: u32 = 25;

/// Every image of every board; the product with its bus on CAN last.
fn images() -> impl Iterator<Item = (&'static str, &'static str)> {
    let usual = BOARDS.into_iter();
    usual
        .flat_map(|board| IMAGES.map(|image| (board, image)))
        .chain(CAN_BOARDS.map(|board| (board, "ecu-can")))
}

fn memory_map(board: &str) -> Map {
    let path = root()
        .join("firmware/src/board")
        .join(board)
        .join("memory.x");
    let text = fs::read_to_string(&path).expect("every board has a memory map");
    Map::parse(&text).unwrap_or_else(|error| panic!("{board}: {error}"))
}

fn proven_stack(place: &str, image: &Image) -> Stack {
    let stack = Stack::analyse(&image.bytes, &PRIORITIES)
        .unwrap_or_else(|error| panic!("{place}: {error}"));
    assert_eq!(
        stack.problems,
        [] as [&str; 0],
        "{place}: there is no bound"
    );
    assert!(
        stack.fits(),
        "{place}: {} of {} bytes",
        stack.worst_bytes,
        stack.room_bytes
    );
    stack
}

#[test]
fn worst_stack() {
    let mut figures = Vec::new();
    let mut compiler = String::new();
    for (board, name) in images() {
        let image = board_image(board, name);
        let place = format!("{board}/{name}");
        let stack = proven_stack(&place, &image);
        // Two independent sources: the compiler's figures, and the instructions.
        assert!(
            10 * stack.confirmed_functions >= 9 * stack.stated_functions,
            "{place}: {} of {} frames confirmed",
            stack.confirmed_functions,
            stack.stated_functions
        );
        for level in &stack.levels {
            let name = format!("{place}/{}", level.name.replace(' ', "-"));
            figures.push(Figure::new(name, level.bytes, "bytes"));
        }
        let saved = stack.exception_frames_bytes;
        figures.push(Figure::new(
            format!("{place}/saved-by-the-core"),
            saved,
            "bytes",
        ));
        let worst = Figure::new(format!("{place}/worst"), stack.worst_bytes, "bytes");
        figures.push(worst.at_most(STACK_LIMIT_BYTES));
        figures.push(Figure::new(
            format!("{place}/room"),
            stack.room_bytes,
            "bytes",
        ));
        compiler = image.compiler;
    }
    let about = "Worst stack of both images on each board: levels that interrupt each other, their sum, and the RAM for it.";
    check_figures("stack.txt", about, &compiler, &figures);
}

/// Nothing that was ever measured is deeper than the bound, and the bound is not from another
/// world.
#[test]
fn no_run_is_deeper_than_the_bound() {
    let bound = proven_stack("mps2", &image("bench")).worst_bytes;
    let mut scenarios = Vec::new();
    for waveform in [Waveform::None, Waveform::Square, Waveform::Sine] {
        scenarios.push(scenario(waveform, Application::Averaged));
        scenarios.push(scenario(waveform, Application::Signal));
    }
    // The program's deepest paths: every alternative of the model that calls more.
    let mut largest = scenario(Waveform::Sine, Application::Averaged);
    largest.friction.law = FrictionLaw::PrintedAngle;
    largest.tires.model = TireModel::MagicFormula;
    largest.vehicle.slip_form = SlipForm::Exact;
    largest.run.control_rate_hz = 20.0;
    scenarios.push(largest);
    let depths = scenarios
        .iter()
        .map(|scenario| record(scenario, Machine::Mps2An386, 0).trailer.stack_bytes);
    let deepest = depths.max().unwrap_or(0);
    println!("deepest measured {deepest} of at most {bound} bytes");
    assert!(deepest <= bound, "{deepest} bytes measured, bound {bound}");
    assert!(
        4 * deepest >= bound,
        "{deepest} bytes measured, bound {bound}"
    );
}

#[test]
fn flash_and_ram() {
    let mut figures = Vec::new();
    let mut compiler = String::new();
    for (board, name) in images() {
        let map = memory_map(board);
        let image = board_image(board, name);
        let place = format!("{board}/{name}");
        assert!(image.flash_bytes <= map.flash_bytes, "{place}: flash");
        assert!(image.ram_bytes <= map.ram_bytes, "{place}: RAM");
        for (what, bytes, limit, there) in [
            (
                "flash",
                image.flash_bytes,
                FLASH_LIMIT_BYTES,
                map.flash_bytes,
            ),
            ("ram", image.ram_bytes, RAM_LIMIT_BYTES, map.ram_bytes),
        ] {
            let taken = Figure::new(format!("{place}/{what}"), bytes as u32, "bytes");
            figures.push(taken.at_most(limit));
            figures.push(Figure::new(
                format!("{place}/{what}-there-is"),
                there as u32,
                "bytes",
            ));
        }
        compiler = image.compiler;
    }
    let about =
        "Flash and RAM (without stack) that each image takes of its board, and what the board has.";
    check_figures("sizes.txt", about, &compiler, &figures);
}

/// Beside the link that proves it: the image holds no code that panics.
#[test]
fn sr19_no_panic_is_in_the_panic_free_image() {
    let usual = BOARDS.map(|board| (board, "panic-free"));
    let can = CAN_BOARDS.map(|board| (board, "panic-free-can"));
    for (board, name) in usual.into_iter().chain(can) {
        let functions = function_names(&board_image(board, name));
        assert!(
            functions.iter().any(|name| name == "SysTick"),
            "{board}: {functions:?}"
        );
        let panics: Vec<_> = functions
            .iter()
            .filter(|name| name.contains("panic"))
            .collect();
        assert_eq!(panics, [] as [&str; 0], "{board}");
        let others = function_names(&board_image(board, "bench"));
        assert!(
            others.iter().any(|name| name.contains("panic")),
            "the ECU's image has a handler at least"
        );
    }
}

fn function_names(image: &Image) -> Vec<String> {
    image::function_names(&image.bytes).expect("the image can be read")
}

fn instruction_figures(run: &str, instructions: &Instructions) -> Vec<Figure> {
    let figure = |what: &str, value: u32| Figure::new(format!("{run}/{what}"), value, "instr");
    let percent = (1000.0 * instructions.worst_share()).round() / 10.0;
    vec![
        figure("control-median", median(&instructions.control)),
        figure("control-most", most(&instructions.control)),
        figure("pwm-median", median(&instructions.pwm)),
        figure("pwm-most", most(&instructions.pwm)),
        Figure::new(format!("{run}/worst-share"), percent, "%").at_most(100.0),
    ]
}

fn drive() -> Instructions {
    let file = root().join("examples/manoeuvres/constant-speed.toml");
    let (mut scenario, manoeuvre): (_, Manoeuvre) =
        manoeuvre::load(&file).unwrap_or_else(|error| panic!("{error}"));
    scenario.run.duration_s = 5.0;
    let target = Target {
        image: image("bench"),
        machine: Machine::Mps2An386,
        link: LinkKind::Files,
        time_out: TIME_OUT,
    };
    let vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("the example is valid");
    let ecu = ecu_scenario(&scenario, &manoeuvre);
    let run =
        on_processor(&ecu, vehicle, &target, &mut || {}).unwrap_or_else(|error| panic!("{error}"));
    Instructions::in_loop(&run.costs, &scenario, target.machine)
}

#[test]
fn instructions_per_tick() {
    let mut figures = Vec::new();
    for (name, waveform, application) in [
        ("open-loop/none", Waveform::None, Application::Averaged),
        ("open-loop/square", Waveform::Square, Application::Averaged),
        ("open-loop/sine", Waveform::Sine, Application::Averaged),
        (
            "open-loop/square-signal",
            Waveform::Square,
            Application::Signal,
        ),
        ("open-loop/sine-signal", Waveform::Sine, Application::Signal),
    ] {
        let recording = record(&scenario(waveform, application), Machine::Mps2An386, 0);
        figures.extend(instruction_figures(name, &Instructions::of(&recording)));
    }
    figures.extend(instruction_figures("in-loop/square", &drive()));
    let about = "Instructions (no cycles) of the tasks on the board mps2: median and most of the control task and of the slowest PWM\n\
                 task of a tick, and the share of a tick that both take at worst. The dither sets in on the way.";
    check_figures(
        "instructions.txt",
        about,
        &image("bench").compiler,
        &figures,
    );
}

/// PWM interrupts, at least, at each rate.
const INTERRUPTS: f32 = 1e5;

#[test]
fn jitter_of_interrupts() {
    let mut figures = Vec::new();
    for pwm_rate_hz in [10_000.0, 20_000.0, 50_000.0_f32] {
        let mut scenario = scenario(Waveform::Sine, Application::Averaged);
        scenario.run.pwm_rate_hz = pwm_rate_hz;
        scenario.run.duration_s = INTERRUPTS / pwm_rate_hz + 0.5;
        let recording = record(&scenario, Machine::Mps2An386, 0);
        assert!(recording.duties.len() as f32 >= INTERRUPTS);
        let (least, most) = (
            recording.trailer.min_interval,
            recording.trailer.max_interval,
        );
        let nominal = f32::from(recording.header.pwm_period);
        assert!(
            f32::from(least) <= nominal && nominal <= f32::from(most),
            "{least} to {most}"
        );
        let name = |what: &str| format!("{pwm_rate_hz}-Hz/{what}");
        figures.push(Figure::new(name("nominal"), nominal, "counts"));
        figures.push(Figure::new(name("least"), least, "counts"));
        figures.push(Figure::new(name("most"), most, "counts"));
        let spread = Figure::new(name("spread"), most - least, "counts");
        figures.push(spread.at_most(JITTER_LIMIT_COUNTS));
    }
    let about = "Counts of 40 ns of an independent timer between PWM interrupts, over 100,000 of them at each rate, while the control task\n\
                 works; in the emulator's time, in which an instruction takes 32 ns. That is no measurement of silicon.";
    check_figures("jitter.txt", about, &image("bench").compiler, &figures);
}
