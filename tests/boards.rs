//! The same ECU on other boards: an STM32F405 whose timer is inspected from outside, and the images
//! of all boards.

use dynamics::simulate::simulate;
use pil::equivalence::bits;
use pil::equivalence::trace_of;
use qemu::debug::Debugged;
use qemu::gdb::{Register, Stop};
use qemu::telemetry::Recording;
use qemu::{Machine, SocketError};
use qemu::{qmp::Qmp, settings};
use shared_model::Scenario;
use shared_model::dither::{Application, Waveform};
use shared_model::friction::FrictionLaw;
use shared_model::open_loop::OpenLoop;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tests::{TELEMETRY, TIME_OUT, board_image, record, run};

const STM32F405: Machine = Machine::NetduinoPlus2;
/// Clock of its timers without PLL, Hz.
const STM32F405_TIMER_HZ: f32 = 16e6;
const BOARDS: [&str; 4] = ["mps2", "netduinoplus2", "nrf52840dk", "nucleog474re"];
const BAD_SCENARIO: i32 = 10;
/// Start of every Cortex-M's RAM.
const RAM_START: u64 = 0x2000_0000;

/// Registers of TIM3, as in the reference manual RM0090, 18.4.
const TIM3: u32 = 0x4000_0400;
const CR1: u32 = TIM3;
const CCMR1: u32 = TIM3 + 0x18;
const CCER: u32 = TIM3 + 0x20;
const PSC: u32 = TIM3 + 0x28;
const ARR: u32 = TIM3 + 0x2C;
const CCR1: u32 = TIM3 + 0x34;

fn scenario(waveform: Waveform) -> Scenario<f32> {
    let mut scenario = tests::scenario(waveform, Application::Averaged);
    scenario.servo.timer_clock_hz = STM32F405_TIMER_HZ;
    scenario
}

#[test]
fn the_same_program_gives_the_same_bits() {
    for waveform in [Waveform::None, Waveform::Square, Waveform::Sine] {
        for law in [FrictionLaw::CoulombRate, FrictionLaw::PrintedAngle] {
            let mut scenario = scenario(waveform);
            scenario.friction.law = law;
            let firmware = trace_of(&record(&scenario, STM32F405, 0));
            let host = simulate(&scenario).expect("the scenario is valid");
            let bits = bits(&firmware, &host);
            assert_eq!(bits.differing, 0, "{:?} in {scenario:?}", bits.first);
            let words = host.states.len() * 5 + host.duties.len();
            assert_eq!(bits.compared, words + 5, "everything was compared");
        }
    }
}

/// Stops the core at every PWM interrupt, where the timer still holds the duty of the interrupt
/// before.
///
/// A stop takes away the time till the next interrupt (see `pil::gdb`), so the model's one step is
/// due after the last.
#[test]
fn every_duty_is_in_the_timers_register() {
    for waveform in [Waveform::Square, Waveform::Sine] {
        let mut scenario = scenario(waveform);
        scenario.dither.start_time_s = 0.0;
        scenario.run.control_rate_hz = 10.0;
        scenario.run.duration_s = 0.1;
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let mut run = start(&scenario, folder.path());
        let interrupt = to_interrupt(&mut run);

        // PWM mode 1 with preload, the output on, the counter running at the timer's full clock.
        let qmp = &mut run.qmp;
        assert_eq!(read(qmp, CCMR1) & 0xFF, 0b0110_1000);
        assert_eq!(read(qmp, CCER) & 0b11, 1);
        assert_eq!(read(qmp, CR1) & 1, 1);
        assert_eq!(read(qmp, PSC), 0);
        assert_eq!(read(qmp, CCR1), 800, "neutral before the first interrupt");

        // After the last of the thousand there is no interrupt to stop at.
        let found: Vec<(u32, u32)> = (0..999)
            .map(|_| {
                let stop = run.gdb.run_to_stop(TIME_OUT).expect("the core stops");
                assert_eq!(stop, Stop::Breakpoint);
                assert_eq!(run.gdb.read_register(Register::Pc).ok(), Some(interrupt));
                (read(&mut run.qmp, CCR1), read(&mut run.qmp, ARR))
            })
            .collect();
        assert_eq!(found, expected_registers(&scenario));
        // The comparison can fail: a little more dither is seen.
        let mut other = scenario;
        other.dither.amplitude_v += 0.02;
        assert_ne!(found, expected_registers(&other));

        assert_eq!(run.finish(TIME_OUT).expect("the run ends").exit_code, 0);
        let firmware = trace_of(&open(folder.path()));
        let host = simulate(&scenario).expect("the scenario is valid");
        let bits = bits(&firmware, &host);
        assert_eq!(bits.differing, 0, "{:?}", bits.first);
    }
}

/// The ends of the duty, at another period than usual: a square dither of the whole bus voltage, and
/// no other voltage.
#[test]
fn no_and_full_duty_at_another_period_are_in_the_timers_registers() {
    let mut scenario = scenario(Waveform::Square);
    scenario.dither.start_time_s = 0.0;
    scenario.servo.bus_voltage_v = 0.1;
    scenario.servo.winding_resistance_ohm = 0.0;
    scenario.dither.amplitude_v = 0.1;
    scenario.run.pwm_rate_hz = 20_000.0;
    scenario.run.control_rate_hz = 20.0;
    scenario.run.duration_s = 0.05;
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let mut run = start(&scenario, folder.path());
    assert_eq!(read(&mut run.qmp, CCER) & 1, 0, "off after a reset");
    to_interrupt(&mut run);
    assert_eq!(
        [CCR1, ARR].map(|register| read(&mut run.qmp, register)),
        [400, 799],
        "neutral before the first interrupt"
    );
    let expected = expected_registers(&scenario);
    for end in [0, 800] {
        assert!(expected.iter().any(|&(code, _)| code == end), "{end}");
    }
    let found: Vec<(u32, u32)> = (0..expected.len())
        .map(|_| {
            let stop = run.gdb.run_to_stop(TIME_OUT).expect("the core stops");
            assert_eq!(stop, Stop::Breakpoint);
            (read(&mut run.qmp, CCR1), read(&mut run.qmp, ARR))
        })
        .collect();
    assert_eq!(found, expected);
}

/// Data written to the RAM through the core is visible past it, and conversely; there is nothing
/// where nothing is mapped.
#[test]
fn memory_is_read_and_written() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let mut run = start(&scenario(Waveform::None), folder.path());
    let image = board_image(STM32F405.board(), "bench");
    let free = image.address_of("__sheap").expect("RAM ends somewhere");
    let free = free.next_multiple_of(4);
    let gdb = &mut run.gdb;
    gdb.write_memory(free, &[0x78, 0x56, 0x34, 0x12])
        .expect("there is RAM");
    assert_eq!(gdb.read_memory(free + 1, 2).ok(), Some(vec![0x56, 0x34]));
    assert_eq!(read(&mut run.qmp, free), 0x1234_5678);
    assert!(run.gdb.read_memory(0xF000_0000, 4).is_err());
    assert!(run.qmp.read_word(0xF000_0000).is_err());
}

#[test]
fn core_registers_are_read_and_written() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let mut run = start(&scenario(Waveform::None), folder.path());
    let image = board_image(STM32F405.board(), "bench");
    let top = image.address_of("_stack_start");
    assert_eq!(run.gdb.read_register(Register::Sp).ok(), top);
    let interrupt = to_interrupt(&mut run);
    for (register, value) in [(Register::R(3), 0x1234_5678), (Register::Lr, 0xFFFF_FFF9)] {
        run.gdb
            .write_register(register, value)
            .expect("the core takes it");
        assert_eq!(run.gdb.read_register(register).ok(), Some(value));
    }
    let status = run.gdb.read_register(Register::Xpsr).expect("it has one");
    assert_eq!(status & 0x1FF, 15, "SysTick is exception 15");
    run.gdb
        .remove_breakpoint(interrupt)
        .expect("the breakpoint was set");
}

#[test]
fn the_end_of_the_program_is_a_stop() {
    let mut scenario = scenario(Waveform::None);
    scenario.run.wheel_speed_rpm = 0.0;
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let mut run = start(&scenario, folder.path());
    let stop = run.gdb.run_to_stop(TIME_OUT).expect("the program ends");
    assert_eq!(stop, Stop::Exited(BAD_SCENARIO as u8));
}

#[test]
fn a_core_that_does_not_stop_is_a_time_out() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let image = board_image(STM32F405.board(), "bench");
    let hang = ["fault=hang".to_owned()];
    let mut run = Debugged::start(&image, STM32F405, &hang, folder.path(), TIME_OUT)
        .unwrap_or_else(|error| panic!("{error}"));
    let stop = run.gdb.run_to_stop(Duration::from_millis(300));
    assert!(matches!(stop, Err(SocketError::TimedOut(_))), "{stop:?}");
}

#[test]
fn a_scenario_for_another_timer_is_refused() {
    for (machine, timer_clock_hz) in [(STM32F405, "25000000"), (Machine::Mps2An386, "16000000")] {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let image = board_image(machine.board(), "bench");
        let setting = format!("servo.timer_clock_hz={timer_clock_hz}");
        let finished = run(&image, machine, &[setting], folder.path(), TIME_OUT)
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(finished.exit_code, BAD_SCENARIO, "{:?}", finished.log);
        let line = finished.log.last().expect("it has a reason");
        assert!(
            line.contains(&format!("servo.timer_clock_hz = {timer_clock_hz}")),
            "{line}"
        );
    }
}

#[test]
fn without_a_word_about_it_the_timer_is_the_boards() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let image = board_image(STM32F405.board(), "bench");
    let settings = [
        "preset=printed",
        "run.duration_s=0.1",
        "telemetry=telemetry.bin",
    ];
    let settings = settings.map(String::from);
    let finished = run(&image, STM32F405, &settings, folder.path(), TIME_OUT)
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(finished.exit_code, 0, "{:?}", finished.log);
    assert_eq!(open(folder.path()).header.pwm_period, 1600);
}

/// The trailer's duty is read back from the timer. No watchdog here: the emulator has none for this
/// chip.
#[test]
fn faults_put_the_timer_to_neutral() {
    for (fault, exit_code) in [("panic", 13), ("hard-fault", 14), ("stack-overflow", 14)] {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let image = board_image(STM32F405.board(), "bench");
        let finished = run(
            &image,
            STM32F405,
            &[format!("fault={fault}")],
            folder.path(),
            TIME_OUT,
        )
        .unwrap_or_else(|error| panic!("{fault}: {error}"));
        assert_eq!(finished.exit_code, exit_code, "{fault}");
        let recording = Recording::open(&folder.path().join("drill.bin"))
            .unwrap_or_else(|error| panic!("{fault}: {error}"));
        assert_eq!(recording.header.pwm_period, 1600, "{fault}");
        assert_eq!(recording.trailer.neutral_duty, 800, "{fault}");
        // The drill drives the PWM to full duty before the fault.
        assert_eq!(recording.trailer.final_duty, 800, "{fault}");
    }
}

/// What an image needs fits its board's memory map, which it is linked to.
#[test]
fn every_image_fits_its_board() {
    for board in BOARDS {
        let map = memory_map(board);
        for name in ["ecu", "bench"] {
            let image = board_image(board, name);
            let [flash, stack, ram] = ["FLASH", "STACK", "RAM"].map(|name| region(&map, name));
            let start = image.address_of("__vector_table").map(u64::from);
            assert_eq!(start, Some(flash.0), "{board}: {name}");
            let ends = ["_stack_end", "_stack_start"].map(|end| image.address_of(end));
            let ends = ends.map(|end| end.map(u64::from));
            let stack_end = stack.0 + stack.1;
            assert_eq!(ends, [Some(stack.0), Some(stack_end)], "{board}: {name}");
            // Below the stack is no RAM, so that an overflow faults.
            assert_eq!((stack.0, stack_end), (RAM_START, ram.0), "{board}: {name}");
            println!(
                "{board} {name}: {} of {} bytes of flash, {} of {} of RAM",
                image.flash_bytes, flash.1, image.ram_bytes, ram.1
            );
            assert!(image.flash_bytes <= flash.1, "{board}: {name}");
            assert!(image.ram_bytes <= ram.1, "{board}: {name}");
        }
    }
}

/// Every folder of a board is among the boards tested here.
#[test]
fn no_board_is_left_out() {
    let folders = std::fs::read_dir(boards_folder()).expect("the boards are there");
    let folders = folders.flatten().filter(|entry| entry.path().is_dir());
    let mut found: Vec<String> = folders
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    found.sort();
    assert_eq!(found, BOARDS);
}

/// The ECU with a scenario, before its first instruction.
fn start(scenario: &Scenario<f32>, folder: &Path) -> Debugged {
    let image = board_image(STM32F405.board(), "bench");
    let mut settings = settings::of(scenario);
    settings.push(format!("telemetry={TELEMETRY}"));
    Debugged::start(&image, STM32F405, &settings, folder, TIME_OUT)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Continues to the first PWM interrupt and returns its address, with a breakpoint there.
fn to_interrupt(run: &mut Debugged) -> u32 {
    let image = board_image(STM32F405.board(), "bench");
    let interrupt = image.address_of("SysTick").expect("it has the interrupt");
    run.gdb
        .set_breakpoint(interrupt)
        .expect("a breakpoint can be set");
    let stop = run.gdb.run_to_stop(TIME_OUT).expect("the core stops");
    assert_eq!(stop, Stop::Breakpoint);
    assert_eq!(run.gdb.read_register(Register::Pc).ok(), Some(interrupt));
    interrupt
}

fn read(qmp: &mut Qmp, address: u32) -> u32 {
    qmp.read_word(address)
        .unwrap_or_else(|error| panic!("{error}"))
}

fn open(folder: &Path) -> Recording {
    Recording::open(&folder.join(TELEMETRY)).unwrap_or_else(|error| panic!("{error}"))
}

/// CCR and ARR of the timer in every period of the host's own run but the last.
fn expected_registers(scenario: &Scenario<f32>) -> Vec<(u32, u32)> {
    let mut ecu = OpenLoop::new(scenario).expect("the scenario is valid");
    let mut registers = Vec::new();
    for _ in 0..scenario.steps() {
        ecu.step(|duty| registers.push((duty.code().into(), u32::from(duty.period()) - 1)));
    }
    registers.pop();
    registers
}

fn boards_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../firmware/src/board")
}

fn memory_map(board: &str) -> String {
    let path = boards_folder().join(board).join("memory.x");
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Origin and length of a region, bytes, from a line as `RAM   : ORIGIN = 0x20000000, LENGTH =
/// 128K`.
fn region(map: &str, name: &str) -> (u64, u64) {
    let line = map.lines().find_map(|line| {
        let (origin, length) = line.trim().strip_prefix(name)?.split_once(", LENGTH = ")?;
        let (_, origin) = origin.split_once("ORIGIN = 0x")?;
        let kibibytes: u64 = length.trim().strip_suffix('K')?.parse().ok()?;
        Some((u64::from_str_radix(origin, 16).ok()?, kibibytes * 1024))
    });
    line.unwrap_or_else(|| panic!("the map has no {name}: {map}"))
}
