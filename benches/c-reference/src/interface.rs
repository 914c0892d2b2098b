//! The interface of the Rust program and the C reference: the declarations of `c/reference.h`.

use core::ffi::c_void;
use shared_model::Scenario;
use shared_model::delayed_feedback::OrbitSchedule;
use shared_model::delayed_feedback::table::{DITHERED, POINTS as ORBIT_POINTS, UNDITHERED};
use shared_model::dither::{Injection, Waveform};
use shared_model::ecu::{ControlInput, ControlOutput};
use shared_model::exchange::FRAME_LEN;
use shared_model::friction::FrictionLaw;
use shared_model::gate::Setpoint;
use shared_model::schedule_table::{POINTS, SINE, SQUARE};
use shared_model::tire::TireModel;
use shared_model::vehicle::{SlipForm, State};

/// A call that is counted: task, input, output.
// SAFETY: a type; each call has its own reason.
pub type Call = unsafe extern "C" fn(*mut c_void, *const c_void, *mut c_void);

/// Periods and gains of the delayed feedback.
#[repr(C)]
struct Orbits {
    motor_current_a: f32,
    first_rpm: f32,
    step_rpm: f32,
    periods_s: *const f32,
    gains: *const f32,
}

/// The choices of a scenario.
#[repr(C)]
pub struct Choice {
    waveform: u32,
    suppressing_waveform: u32,
    has_feedback: u32,
    orbits: Orbits,
    slip_form: u32,
    tire: u32,
    friction_law: u32,
    friction_dithered: u32,
    wheel_speed_rpm: f32,
    start_time_s: f32,
    schedule_first_rpm: f32,
    schedule_step_rpm: f32,
    schedule_amplitudes_v: *const f32,
    clock_hz: u32,
}

fn number(waveform: Waveform) -> u32 {
    match waveform {
        Waveform::None => 0,
        Waveform::Square => 1,
        Waveform::Sine => 2,
    }
}

static NO_AMPLITUDES: [f32; POINTS] = [0.0; POINTS];

impl Choice {
    pub fn of(scenario: &Scenario<f32>, clock_hz: u32) -> Self {
        let amplitudes_v = match scenario.suppressing_waveform() {
            Waveform::None => &NO_AMPLITUDES,
            Waveform::Square => &SQUARE.amplitudes_v,
            Waveform::Sine => &SINE.amplitudes_v,
        };
        let orbits: &'static OrbitSchedule<f32, ORBIT_POINTS> =
            match scenario.suppressing_waveform() {
                Waveform::None => &UNDITHERED,
                Waveform::Square | Waveform::Sine => &DITHERED,
            };
        Self {
            waveform: number(scenario.dither.waveform),
            suppressing_waveform: number(scenario.suppressing_waveform()),
            has_feedback: scenario.controller.suppression.has_feedback().into(),
            orbits: Orbits {
                motor_current_a: orbits.motor_current_a,
                first_rpm: orbits.first_rpm,
                step_rpm: orbits.step_rpm,
                periods_s: orbits.periods_s.as_ptr(),
                gains: orbits.gains.as_ptr(),
            },
            slip_form: match scenario.vehicle.slip_form {
                SlipForm::SmallAngle => 0,
                SlipForm::Exact => 1,
            },
            tire: match scenario.tires.model {
                TireModel::Cubic => 0,
                TireModel::MagicFormula => 1,
            },
            friction_law: match scenario.friction.law {
                FrictionLaw::None => 0,
                FrictionLaw::CoulombRate => 1,
                FrictionLaw::PrintedAngle => 2,
            },
            friction_dithered: scenario.friction.dithered.into(),
            wheel_speed_rpm: scenario.run.wheel_speed_rpm,
            start_time_s: scenario.dither.start_time_s,
            schedule_first_rpm: SQUARE.first_rpm,
            schedule_step_rpm: SQUARE.step_rpm,
            schedule_amplitudes_v: amplitudes_v.as_ptr(),
            clock_hz,
        }
    }
}

/// The model's state. Equal if its bits are.
#[repr(C)]
#[derive(Clone, Copy, Default, PartialEq)]
pub struct StateBits {
    x: [u32; 4],
    friction: u32,
}

impl From<&State<f32>> for StateBits {
    fn from(state: &State<f32>) -> Self {
        let [x] = state.x.data.0;
        Self {
            x: x.map(f32::to_bits),
            friction: state.friction as u32,
        }
    }
}

/// The dither's injection.
#[repr(C)]
pub struct InjectionOf {
    kind: u32,
    rad: f32,
}

impl From<&Injection<f32>> for InjectionOf {
    fn from(injection: &Injection<f32>) -> Self {
        let (kind, rad) = match *injection {
            Injection::Off => (0, 0.0),
            Injection::SquareMean { amplitude } => (1, amplitude),
            Injection::SineMean { amplitude } => (2, amplitude),
            Injection::Shift { offset } => (3, offset),
        };
        Self { kind, rad }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Default, PartialEq)]
struct SetpointBits {
    motor_v: u32,
    dither_amplitude_v: u32,
}

impl From<&Setpoint<f32>> for SetpointBits {
    fn from(setpoint: &Setpoint<f32>) -> Self {
        Self {
            motor_v: setpoint.motor_v.to_bits(),
            dither_amplitude_v: setpoint.dither_amplitude_v.to_bits(),
        }
    }
}

/// Input of a PWM period.
#[repr(C)]
#[derive(Default)]
pub struct PwmInputOf {
    has_setpoints: bool,
    setpoints: [SetpointBits; 2],
    bridge_on: [bool; 2],
    pin_error: u16,
}

impl PwmInputOf {
    pub fn new(output: Option<&ControlOutput<f32>>, pin_error: u16) -> Self {
        Self {
            has_setpoints: output.is_some(),
            setpoints: output.map_or_else(Default::default, setpoints),
            bridge_on: output.map_or([false; 2], |output| output.bridge_on),
            pin_error,
        }
    }
}

fn setpoints(output: &ControlOutput<f32>) -> [SetpointBits; 2] {
    let [a, b] = &output.setpoints;
    [a.into(), b.into()]
}

/// Output of a PWM period, of both languages.
#[repr(C)]
#[derive(Clone, Copy, Default, PartialEq)]
pub struct PwmOutput {
    pub duty_code: u16,
    pub control_due: bool,
    pub bridge_on: bool,
    /// Where a control tick is due.
    pub faults: u32,
}

/// Input of a control tick.
#[repr(C)]
pub struct ControlInputOf {
    has_frame: bool,
    frame: [u8; FRAME_LEN],
    elapsed_counts: u32,
    found_by_pwm: u32,
    bridge_on: bool,
}

impl From<&ControlInput> for ControlInputOf {
    fn from(input: &ControlInput) -> Self {
        Self {
            has_frame: input.frame.is_some(),
            frame: input.frame.unwrap_or_default(),
            elapsed_counts: input.elapsed_counts,
            found_by_pwm: input.found_by_pwm.bits(),
            bridge_on: input.bridge_on,
        }
    }
}

/// Output of a control tick. Equal if its bits are.
#[repr(C)]
#[derive(Clone, Copy, Default, PartialEq)]
pub struct ControlOutputBits {
    setpoints: [SetpointBits; 2],
    bridges_on: [bool; 2],
    frame: [u8; FRAME_LEN],
    mode: u32,
    faults: u32,
    motor_voltage_v: u32,
    dither_amplitude_v: u32,
    wheel_speed_limit_rpm: u32,
    warnings: u16,
    sensor_counter: u8,
    bridge_on: bool,
    challenge: u8,
}

impl From<&ControlOutput<f32>> for ControlOutputBits {
    fn from(output: &ControlOutput<f32>) -> Self {
        let actuation = &output.actuation;
        Self {
            setpoints: setpoints(output),
            bridges_on: output.bridge_on,
            frame: output.frame,
            mode: actuation.mode as u32,
            faults: actuation.faults,
            motor_voltage_v: actuation.motor_voltage_v.to_bits(),
            dither_amplitude_v: actuation.dither_amplitude_v.to_bits(),
            wheel_speed_limit_rpm: actuation.wheel_speed_limit_rpm.to_bits(),
            warnings: actuation.warnings,
            sensor_counter: actuation.sensor_counter,
            bridge_on: actuation.bridge_on,
            challenge: actuation.challenge,
        }
    }
}

// SAFETY: declared as in reference.h.
unsafe extern "C" {
    pub fn reference_model_size() -> usize;
    pub fn reference_pwm_size() -> usize;
    pub fn reference_control_size() -> usize;
    pub fn reference_model_init(memory: *mut c_void, choice: *const Choice);
    pub fn reference_pwm_init(memory: *mut c_void, choice: *const Choice);
    pub fn reference_control_init(memory: *mut c_void, choice: *const Choice);
    pub fn reference_model_set_state(memory: *mut c_void, state: *const StateBits);
    pub fn reference_model_state(memory: *const c_void, state: *mut StateBits);
    pub fn reference_model_step(memory: *mut c_void, injection: *const c_void, unused: *mut c_void);
    pub fn reference_pwm_period(memory: *mut c_void, input: *const c_void, output: *mut c_void);
    pub fn reference_control_tick(memory: *mut c_void, input: *const c_void, output: *mut c_void);
}

macro_rules! share {
    ($($name:ident = $function:path;)*) => {$(
        // SAFETY: the one function of that name.
        #[unsafe(no_mangle)]
        extern "C" fn $name(x: f32) -> f32 {
            $function(x)
        }
    )*};
}

// The transcendental functions are those of one library for both.
share! {
    reference_sinf = shared_model::Real::sin;
    reference_cosf = shared_model::Real::cos;
    reference_atanf = shared_model::Real::atan;
    reference_asinf = shared_model::Real::asin;
}
