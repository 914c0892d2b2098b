//! Waivers: faults that may stay undetected, each with its rationale. Any other undetected fault
//! fails the campaign.

use super::catalogue::{ControllerFailure, Fault, Kind, SensorFailure, ServoFailure, Signal};
use super::injection::Injection;
use super::processor_fault::{Action, ProcessorFault};

/// Greatest step of the wheel speed that is plausible for a vehicle, as a share of its range: 20 of
/// 4000 rpm.
const WHEEL_SPEED_SHARE: f32 = 0.005;
/// The same for a signal that enters no command but that of the delayed feedback.
const MONITORED_SHARE: f32 = 0.03;
/// The gate's slew of the motor's share in a control tick, V.
const MOTOR_OFFSET_V: f32 = 0.004;
/// Share by which the amplitude may be wrong: period one is kept from -6 to +19 %.
const AMPLITUDE_SHARE: f32 = 0.11;
/// First data address of every Cortex-M; code has lower addresses.
const RAM_START: u32 = 0x2000_0000;

struct Waiver {
    covers: fn(&Injection) -> bool,
    rationale: &'static str,
}

const WAIVERS: [Waiver; 7] = [
    Waiver {
        covers: |injection| match kind(injection) {
            Some(Kind::Sensor(Signal::WheelSpeed, failure)) => is_slow(failure, WHEEL_SPEED_SHARE),
            _ => false,
        },
        rationale: "the wheel speed is wrong by less than the road can change it: no second sensor measures it; the dither has \
                    the amplitude of a neighbouring speed",
    },
    Waiver {
        covers: |injection| match kind(injection) {
            Some(Kind::Sensor(
                Signal::YawRate | Signal::SteeringAngle | Signal::SteeringRate,
                failure,
            )) => is_slow(failure, MONITORED_SHARE),
            _ => false,
        },
        rationale: "the yaw rate, steering angle or steering rate has a small or slow error: no second sensor measures them; only \
                    the delayed feedback uses one in a command, and its torque keeps its limit",
    },
    Waiver {
        covers: |injection| match kind(injection) {
            Some(Kind::Sensor(Signal::CurrentRequest, failure)) => {
                is_slow(failure, 1.0) || failure == SensorFailure::DropOut
            }
            _ => false,
        },
        rationale: "the current request has another value within its range: the driver chooses it, and it may step; the limit and \
                    the slew of the controller apply",
    },
    Waiver {
        covers: |injection| matches!(kind(injection), Some(Kind::ServoBehindReadback(_))),
        rationale: "the servo fails after the pin that is read back: the ECU has no other measurement of it, and closes no loop \
                    over the vehicle",
    },
    Waiver {
        covers: |injection| {
            matches!(
                kind(injection),
                Some(Kind::Servo(
                    ServoFailure::DitherPhase { periods: 1 }
                        | ServoFailure::DitherFrequency { held: 2 }
                ))
            )
        },
        rationale: "the edges of a square dither are late by one PWM period: there are never two wrong duties in a row, and one is \
                    interpreted as a capture on an edge",
    },
    Waiver {
        covers: |injection| match kind(injection) {
            Some(Kind::Controller(failure)) => is_within_gate(failure),
            _ => false,
        },
        rationale: "the controller's command is wrong and within the gate's limits: the gate bounds the command and does not \
                    compute it a second time; an amplitude so close still suppresses the chaos, and a torque keeps its limit",
    },
    Waiver {
        covers: |injection| {
            let Injection::Processor(ProcessorFault { action, .. }) = injection else {
                return false;
            };
            matches!(action, Action::Flip { address, .. } if *address < RAM_START)
        },
        rationale: "a bit of the code is flipped: both channels run the same program; flash with error correction, or a running \
                    checksum, would detect it",
    },
];

fn kind(injection: &Injection) -> Option<Kind> {
    match injection {
        Injection::Loop(Fault { kind, .. }) => Some(*kind),
        Injection::Processor(_) => None,
    }
}

/// No step greater than that share of the range.
fn is_slow(failure: SensorFailure, max_share: f32) -> bool {
    match failure {
        SensorFailure::Stuck | SensorFailure::Drift(_) => true,
        SensorFailure::Step(share) | SensorFailure::Offset(share) => share.abs() <= max_share,
        _ => false,
    }
}

/// A command that the gate's limits allow: the motor's share of a driver who does not move, an error
/// below the slew in a tick, a feedback that is small when its sign changes, an amplitude within the
/// margin of the schedule.
fn is_within_gate(failure: ControllerFailure) -> bool {
    match failure {
        ControllerFailure::MotorOffset(volts) => volts.abs() <= MOTOR_OFFSET_V,
        ControllerFailure::DitherScaled(factor) => (factor - 1.0).abs() <= AMPLITUDE_SHARE,
        ControllerFailure::MotorStuck
        | ControllerFailure::FeedbackInverted
        | ControllerFailure::DitherStuck => true,
        _ => false,
    }
}

/// The rationale of the waiver that covers a fault; `None` if the fault must be detected.
pub fn rationale(injection: &Injection) -> Option<&'static str> {
    let waiver = WAIVERS.iter().find(|waiver| (waiver.covers)(injection));
    waiver.map(|waiver| waiver.rationale)
}
