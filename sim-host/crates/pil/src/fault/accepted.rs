//! Faults that may stay unfound, each with its reason. Any other silent fault fails.

use super::catalogue::{Fault, Kind, SensorFailure, ServoFailure, Signal};
use super::processor::Action;

/// Greatest jump of the wheel speed that passes for one of the vehicle, as a share of its range: 20 of 2500 rpm.
const WHEEL_SPEED_SHARE: f32 = 0.008;
/// The same of a signal that enters no command.
const GUARD_SHARE: f32 = 0.03;

/// Faults that may be silent.
struct Accepted {
    covers: fn(Kind) -> bool,
    reason: &'static str,
}

const ACCEPTED: [Accepted; 5] = [
    Accepted {
        covers: |kind| match kind {
            Kind::Sensor(Signal::WheelSpeed, failure) => is_slow(failure, WHEEL_SPEED_SHARE),
            _ => false,
        },
        reason: "a wheel speed that is off by less than the road could change it: no second sensor says so; the dither gets the \
                 amplitude of a neighbouring speed",
    },
    Accepted {
        covers: |kind| match kind {
            Kind::Sensor(
                Signal::YawRate | Signal::SteeringAngle | Signal::SteeringRate,
                failure,
            ) => is_slow(failure, GUARD_SHARE),
            _ => false,
        },
        reason: "a small or slow error of yaw rate, steering angle or steering rate: they enter no command, they only guard",
    },
    Accepted {
        covers: |kind| match kind {
            Kind::Sensor(Signal::CurrentRequest, failure) => {
                is_slow(failure, 1.0) || failure == SensorFailure::DropOut
            }
            _ => false,
        },
        reason: "another request within its range: it is the driver's to choose, and may step; the policy's limit and slew hold",
    },
    Accepted {
        covers: |kind| matches!(kind, Kind::ServoBehindReadback(_)),
        reason: "a servo that fails behind the pin that is read back: the ECU has no other view of it, and closes no loop over \
                 the vehicle",
    },
    Accepted {
        covers: |kind| {
            matches!(
                kind,
                Kind::Servo(
                    ServoFailure::DitherPhase { periods: 1 }
                        | ServoFailure::DitherFrequency { held: 2 }
                )
            )
        },
        reason: "a square dither whose edges come one PWM period late: never two wrong duties in a row, which is taken for a \
                 capture on an edge",
    },
];

/// Not a jump of more than that share of the range.
fn is_slow(failure: SensorFailure, most: f32) -> bool {
    match failure {
        SensorFailure::Stuck | SensorFailure::Drift(_) => true,
        SensorFailure::Step(share) | SensorFailure::Offset(share) => share.abs() <= most,
        _ => false,
    }
}

/// Why the fault may be silent; `None` if it may not.
pub fn reason(fault: &Fault) -> Option<&'static str> {
    let entry = ACCEPTED.iter().find(|entry| (entry.covers)(fault.kind));
    entry.map(|entry| entry.reason)
}

/// The same of what is done to the processor.
pub fn reason_on_processor(action: Action) -> Option<&'static str> {
    // Variables begin where the code is at its end on every Cortex-M.
    let is_code = matches!(action, Action::Flip { address, .. } if address < 0x2000_0000);
    is_code.then_some(
        "a bit of the program itself: both channels run it; flash with error correction, or a checksum of it, would find it",
    )
}
