#![doc = include_str!("../README.md")]
#![no_std]
#![no_main]

mod count;
mod drive;
mod interface;
// Each image has its logger; this is the laboratory's.
#[path = "../../../firmware/src/bin/bench/log.rs"]
mod log;

use core::ffi::c_void;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use cortex_m_semihosting::debug;
use count::{Copies, REPEATS, Tally, counted};
use drive::Drive;
use firmware::bench::command_line::{self, Command};
use firmware::bench::exit::{ExitCode, end_safely};
use firmware::board::{Board, Current};
use firmware::fault::Fault;
use interface::{
    Call, Choice, ControlInputOf, ControlOutputBits, InjectionOf, PwmInputOf, PwmOutput, StateBits,
};
use shared_model::dither::Injection;
use shared_model::ecu::{ControlInput, ControlOutput, ControlTask, Ecu, PwmTask};
use shared_model::exchange::FRAME_LEN;
use shared_model::friction::FrictionMode;
use shared_model::gate::{Faults, Setpoint};
use shared_model::signal::{Actuation, Mode};
use shared_model::vehicle::{Model, State};
use shared_model::{Scenario, integrate};

/// Steps of the model, a millisecond each.
const STEPS: u32 = 4000;
/// The last step of this number begins in a random state.
const STEPS_PER_TRAJECTORY: u32 = 40;
/// Memory for a task in C, which reports its size.
const MODEL_BYTES: usize = 512;
const PWM_BYTES: usize = 256;
const CONTROL_BYTES: usize = 2560;

/// Memory of a task in C.
#[derive(Clone, Copy)]
#[repr(C, align(8))]
struct Memory<const BYTES: usize>([u8; BYTES]);

impl<const BYTES: usize> Memory<BYTES> {
    /// The memory, filled; `None` if the task needs more.
    fn filled(&mut self, needed: usize, fill: impl FnOnce(*mut c_void)) -> Option<&mut Self> {
        (needed <= BYTES).then(|| {
            fill((&raw mut *self).cast());
            self
        })
    }
}

/// One task in both languages.
struct Pair<T: 'static, const BYTES: usize> {
    name: &'static str,
    rust: &'static mut T,
    rust_call: Call,
    rust_copies: &'static mut Copies<T>,
    rust_tally: &'static mut Tally,
    c: &'static mut Memory<BYTES>,
    c_call: Call,
    c_copies: &'static mut Copies<Memory<BYTES>>,
    c_tally: &'static mut Tally,
}

impl<T: Clone, const BYTES: usize> Pair<T, BYTES> {
    /// The same call in both, counted.
    fn call<RI, RO, CI, CO>(&mut self, rust: (&RI, &mut RO), c: (&CI, &mut CO)) {
        let instructions = counted(self.rust_call, self.rust, self.rust_copies, rust.0, rust.1);
        self.rust_tally.note(instructions);
        let instructions = counted(self.c_call, self.c, self.c_copies, c.0, c.1);
        self.c_tally.note(instructions);
    }

    fn log(&self) {
        for (language, tally) in [("rust", &self.rust_tally), ("c", &self.c_tally)] {
            defmt::info!(
                "cost {=str} {=str} calls {=u32} median {=u32} mean {=u32} most {=u32}",
                self.name,
                language,
                tally.calls(),
                tally.median(),
                tally.mean(),
                tally.most()
            );
        }
    }
}

/// Both tasks with their calls, and memory for the rest.
macro_rules! pair {
    ($name:literal, $type:ty: $rust:expr, $rust_call:path, $bytes:ident: $choice:expr, $size:path, $init:path, $c_call:path) => {
        Pair {
            name: $name,
            rust: cortex_m::singleton!(: $type = $rust)?,
            rust_call: $rust_call,
            rust_copies: cortex_m::singleton!(: Copies<$type> = [const { MaybeUninit::uninit() }; REPEATS])?,
            rust_tally: cortex_m::singleton!(: Tally = Tally::EMPTY)?,
            // In place: on the stack there is less room.
            c: cortex_m::singleton!(: Memory<$bytes> = Memory([0; $bytes]))?.filled(
                // SAFETY: takes nothing.
                unsafe { $size() },
                // SAFETY: there is enough of the memory.
                |memory| unsafe { $init(memory, $choice) },
            )?,
            c_call: $c_call,
            c_copies: cortex_m::singleton!(: Copies<Memory<$bytes>> = [const { MaybeUninit::uninit() }; REPEATS])?,
            c_tally: cortex_m::singleton!(: Tally = Tally::EMPTY)?,
        }
    };
}

#[cortex_m_rt::entry]
fn main() -> ! {
    log::open();
    let code = match command_line::read() {
        Ok(Command::Run(command)) => run(&command.scenario),
        Ok(Command::Drill(_)) | Err(_) => ExitCode::BadScenario,
    };
    end_safely(code)
}

fn run(scenario: &Scenario<f32>) -> ExitCode {
    let Ok(ecu) = Ecu::new(scenario, Current::COST_CLOCK_HZ) else {
        return ExitCode::BadScenario;
    };
    // For its counter; nothing is to interrupt.
    let _ = Current::start_pwm(ecu.pwm.neutral().period());
    Current::stop_pwm_interrupt();
    let choice = Choice::of(scenario, Current::COST_CLOCK_HZ);
    let model = step_model(scenario, &choice);
    let ecu = run_ecu(scenario, ecu, &choice);
    match (model, ecu) {
        (Some(true), Some(true)) => {
            // The host takes a run for complete only if it sees these words.
            defmt::info!("run complete; all bits equal");
            ExitCode::Complete
        }
        (Some(_), Some(_)) => unequal(),
        _ => ExitCode::BadScenario,
    }
}

/// Ends the emulation with exit code 1: the firmware's own codes have none for this.
fn unequal() -> ! {
    defmt::error!("run failed: the bits of Rust and C differ");
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}

/// The model and its state.
#[derive(Clone)]
struct ModelTask {
    model: Model<f32>,
    step_s: f32,
    state: State<f32>,
}

// SAFETY: called with a task and an input of these types.
unsafe extern "C" fn step(task: *mut c_void, input: *const c_void, _output: *mut c_void) {
    // SAFETY: as above.
    let (task, injection) = unsafe {
        (
            &mut *task.cast::<ModelTask>(),
            &*input.cast::<Injection<f32>>(),
        )
    };
    integrate::step(&task.model, &mut task.state, task.step_s, *injection);
}

/// Along a motion, and from states on and off it; true if all are equal.
// Out of line, as the drive: each has the stack for itself.
#[inline(never)]
fn step_model(scenario: &Scenario<f32>, choice: &Choice) -> Option<bool> {
    let model = Model::new(scenario);
    let task = ModelTask {
        model,
        step_s: scenario.step_s(),
        state: model.initial_state(scenario),
    };
    let mut pair = pair!("model-step", ModelTask: task, step, MODEL_BYTES: choice, interface::reference_model_size, interface::reference_model_init, interface::reference_model_step);
    let mut random = Random(1);
    let mut injection = Injection::Off;
    let (mut at_rest, mut changes, mut unequal) = (0_u32, 0_u32, 0_u32);
    for index in 0..STEPS {
        if index == STEPS / 4 {
            injection = scenario.dither.injection(0.0);
        }
        if index % STEPS_PER_TRAJECTORY == STEPS_PER_TRAJECTORY - 1 {
            pair.rust.state = model.state(random.vector().into());
        }
        let before = pair.rust.state.friction;
        let state = StateBits::from(&pair.rust.state);
        // SAFETY: the memory is a model's.
        unsafe { interface::reference_model_set_state((&raw mut *pair.c).cast(), &state) };
        pair.call(
            (&injection, &mut ()),
            (&InjectionOf::from(&injection), &mut ()),
        );
        let mut c = StateBits::default();
        // SAFETY: the memory is a model's.
        unsafe { interface::reference_model_state((&raw const *pair.c).cast(), &mut c) };
        let after = pair.rust.state.friction;
        at_rest += u32::from(after == FrictionMode::Sticking);
        changes += u32::from(before != after);
        unequal += u32::from(StateBits::from(&pair.rust.state) != c);
    }
    pair.log();
    defmt::info!(
        "model-step: {=u32} end at rest, {=u32} change the friction's mode, {=u32} unequal",
        at_rest,
        changes,
        unequal
    );
    Some(unequal == 0)
}

/// Pseudo-random numbers.
struct Random(u32);

impl Random {
    /// From -1 to 1.
    fn number(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / 8_388_608.0 - 1.0
    }

    /// A state vector, of a chaotic motion's size or of one that is coming to rest.
    fn vector(&mut self) -> [f32; 4] {
        let size = if self.number() < 0.0 { 0.1 } else { 1.0 };
        [0.3, 2.0, 0.5, 2.0].map(|most| size * most * self.number())
    }
}

// SAFETY: called with a task, an input and an output of these types.
unsafe extern "C" fn period(task: *mut c_void, input: *const c_void, output: *mut c_void) {
    // SAFETY: as above.
    let (task, input, output) = unsafe {
        (
            &mut *task.cast::<PwmTask<f32>>(),
            &*input.cast::<PwmInput>(),
            &mut *output.cast::<PwmOutput>(),
        )
    };
    let period = task.begin();
    if period.control_due {
        if let Some(output) = &input.output {
            task.accept(output);
        }
    }
    task.end(period.duty.code() ^ input.pin_error);
    *output = PwmOutput {
        duty_code: period.duty.code(),
        control_due: period.control_due,
        bridge_on: period.bridge_on,
        faults: if period.control_due {
            task.faults().bits()
        } else {
            0
        },
    };
}

/// Input of a PWM period.
struct PwmInput {
    output: Option<ControlOutput<f32>>,
    pin_error: u16,
}

// SAFETY: called with a task, an input and an output of these types.
unsafe extern "C" fn tick(task: *mut c_void, input: *const c_void, output: *mut c_void) {
    // SAFETY: as above; the output is one.
    unsafe {
        let task = &mut *task.cast::<ControlTask<f32>>();
        let input = &*input.cast::<ControlInput>();
        *output.cast::<ControlOutput<f32>>() = task.run(input);
    }
}

/// A drive; true if all periods and ticks are equal.
#[inline(never)]
fn run_ecu(scenario: &Scenario<f32>, ecu: Ecu<f32>, choice: &Choice) -> Option<bool> {
    let Ecu { pwm, control, .. } = ecu;
    let mut pwm = pair!("pwm-period", PwmTask<f32>: pwm, period, PWM_BYTES: choice, interface::reference_pwm_size, interface::reference_pwm_init, interface::reference_pwm_period);
    let mut control = pair!("control-tick", ControlTask<f32>: control, tick, CONTROL_BYTES: choice, interface::reference_control_size, interface::reference_control_init, interface::reference_control_tick);
    let mut drive = Drive::new(scenario);
    let nominal_counts = Current::COST_CLOCK_HZ / scenario.run.control_rate_hz as u32;
    let mut input = PwmInput {
        output: None,
        pin_error: 0,
    };
    let (mut ticks, mut periods, mut unequal, mut safe) = (0, 0_u32, 0_u32, 0_u32);
    while ticks < drive::TICKS {
        input.pin_error = Drive::pin_error(periods);
        periods += 1;
        let (mut rust, mut c) = (PwmOutput::default(), PwmOutput::default());
        let of_c = PwmInputOf::new(input.output.as_ref(), input.pin_error);
        pwm.call((&input, &mut rust), (&of_c, &mut c));
        unequal += u32::from(rust != c);
        if !rust.control_due {
            continue;
        }
        let challenge = input.output.map_or(0, |output| output.actuation.challenge);
        let tick_input = ControlInput {
            frame: drive.frame(ticks, challenge),
            elapsed_counts: nominal_counts,
            found_by_pwm: Faults::from_bits(rust.faults),
            bridge_on: rust.bridge_on,
        };
        ticks += 1;
        let mut rust = input.output.unwrap_or(NO_OUTPUT);
        let mut c = ControlOutputBits::default();
        let of_c = ControlInputOf::from(&tick_input);
        control.call((&tick_input, &mut rust), (&of_c, &mut c));
        unequal += u32::from(ControlOutputBits::from(&rust) != c);
        safe += u32::from(rust.actuation.mode == Mode::Safe);
        input.output = Some(rust);
    }
    pwm.log();
    control.log();
    defmt::info!(
        "pwm-period and control-tick: {=u32} ticks in the safe state, {=u32} unequal",
        safe,
        unequal
    );
    Some(unequal == 0)
}

/// Place holder of the output before the first tick.
const NO_OUTPUT: ControlOutput<f32> = ControlOutput {
    setpoints: [Setpoint {
        motor_v: 0.0,
        dither_amplitude_v: 0.0,
    }; 2],
    bridge_on: [true; 2],
    frame: [0; FRAME_LEN],
    actuation: Actuation {
        mode: Mode::Starting,
        faults: 0,
        motor_voltage_v: 0.0,
        dither_amplitude_v: 0.0,
        wheel_speed_limit_rpm: 0.0,
        warnings: 0,
        sensor_counter: 0,
        bridge_on: true,
        challenge: 0,
    },
};

// SAFETY: the one function of that name, with the signature that the firmware's `fault` declares.
#[unsafe(export_name = "enter_safe_state")]
fn end_after_fault(fault: Fault) -> ! {
    end_safely(fault.into())
}

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    end_safely(ExitCode::Panic)
}
