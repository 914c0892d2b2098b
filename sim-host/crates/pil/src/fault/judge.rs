//! Classification of a fault: every run is compared with its fault-free run.

use crate::vehicle_node::VehicleNode;
use serde::Serialize;
use shared_model::e2e::Status;
use shared_model::ecu::Warning;
use shared_model::exchange::Packet;
use shared_model::frame::decode_actuation;
use shared_model::gate::Faults;
use shared_model::signal::{Actuation, Mode};

/// The part of the loop that detected a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detector {
    /// The ECU's gate, with these faults.
    Gate(Faults),
    /// The ECU, with these warning bits.
    Warning(u16),
    /// The vehicle, by its check of an actuator frame.
    Vehicle(Status),
    /// The firmware ended with this exit code, its PWM neutral.
    Firmware(i32),
}

impl Detector {
    /// In words.
    pub fn describe(self) -> String {
        match self {
            Self::Gate(faults) => {
                let names: Vec<_> = faults.iter().map(|fault| fault.name()).collect();
                names.join(" + ")
            }
            Self::Warning(bits) => {
                let set = Warning::ALL.into_iter();
                let set = set.filter(|warning| bits & warning.bit() != 0);
                let names: Vec<_> = set.map(Warning::name).collect();
                format!("warning: {}", names.join(" + "))
            }
            Self::Vehicle(status) => format!("vehicle: {status:?}"),
            Self::Firmware(code) => format!("exit code {code}"),
        }
    }
}

/// The first detection of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Detection {
    /// The detector.
    pub detector: Detector,
    /// Control ticks from the injection to the detection. The ECU's frame that reports it is sent
    /// one tick later.
    pub latency_ticks: u32,
}

/// The reaction to a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reaction {
    /// None.
    None,
    /// The fault was reported, and the ECU continued.
    Tolerated,
    /// The ECU entered its safe state.
    SafeState,
    /// The ECU restarted.
    Restart,
    /// The firmware ended, its PWM neutral.
    Ended,
    /// The ECU stopped sending: the vehicle has no further frames from it.
    LinkLost,
}

impl Reaction {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Tolerated => "tolerated",
            Self::SafeState => "safe state",
            Self::Restart => "restart",
            Self::Ended => "ended, neutral",
            Self::LinkLost => "link lost",
        }
    }
}

/// The class of an outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Detected: the servo was brought to neutral, the ECU restarted, or the vehicle lost the link
    /// to it.
    Detected,
    /// Detected, and the ECU continued.
    Tolerated,
    /// No diagnostic is raised. All outputs are bit-identical to the fault-free run, and no
    /// corrupted value is live.
    NoEffect,
    /// No diagnostic is raised, but an output differs or a corrupted value is live.
    Undetected,
}

/// Greatest angles of the vehicle in an interval.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Peaks {
    /// Greatest magnitude of the front steering angle, rad.
    pub steering_angle_rad: f64,
    /// Greatest magnitude of the slip angle of the front tyres, rad.
    pub front_slip_angle_rad: f64,
}

impl Peaks {
    /// The present angles of the vehicle.
    pub fn of(vehicle: &VehicleNode) -> Self {
        Self {
            steering_angle_rad: vehicle.plant().truth().steering_angle_rad.abs(),
            front_slip_angle_rad: vehicle.plant().front_slip_angle_rad().abs(),
        }
    }

    /// The greater of each.
    pub fn or(self, other: Self) -> Self {
        Self {
            steering_angle_rad: self.steering_angle_rad.max(other.steering_angle_rad),
            front_slip_angle_rad: self.front_slip_angle_rad.max(other.front_slip_angle_rad),
        }
    }
}

/// The outcome of a fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The verdict.
    pub verdict: Verdict,
    /// The first detection, if any.
    pub detection: Option<Detection>,
    /// Reaction of the ECU.
    pub reaction: Reaction,
    /// Greatest angles of the vehicle from the injection on.
    pub peaks: Peaks,
}

/// Observes a run from the injection on.
#[derive(Debug, Clone)]
pub struct Judge {
    periods_per_tick: u32,
    injected_tick: u32,
    detection: Option<Detection>,
    reaction: Reaction,
    differs: bool,
    peaks: Peaks,
}

impl Judge {
    /// For a fault that begins after that control tick.
    pub fn new(periods_per_tick: u32, injected_tick: u32) -> Self {
        Self {
            periods_per_tick,
            injected_tick,
            detection: None,
            reaction: Reaction::None,
            differs: false,
            peaks: Peaks::default(),
        }
    }

    /// Observes a completed PWM period: the ECU's packet, its packet in the fault-free run, and the
    /// vehicle.
    pub fn observe(&mut self, from_ecu: &Packet, fault_free: &Packet, vehicle: &VehicleNode) {
        self.differs |= (from_ecu.duty_code, from_ecu.bridge_on)
            != (fault_free.duty_code, fault_free.bridge_on);
        let (now, expected) = (actuation(from_ecu), actuation(fault_free));
        self.differs |= commands(now.as_ref()) != commands(expected.as_ref());
        let tick = vehicle.periods() / self.periods_per_tick;
        if let Some(actuation) = now {
            self.check(&actuation, tick.saturating_sub(1));
        }
        if vehicle.periods().is_multiple_of(self.periods_per_tick) {
            self.peaks = self.peaks.or(Peaks::of(vehicle));
        }
        let status = vehicle.frame_status();
        if status != Status::Ok {
            self.detect(Detector::Vehicle(status), tick, Reaction::Tolerated);
        }
    }

    fn check(&mut self, actuation: &Actuation<f32>, tick: u32) {
        if actuation.faults != 0 {
            let detector = Detector::Gate(Faults::from_bits(actuation.faults));
            self.detect(detector, tick, Reaction::SafeState);
        }
        if actuation.warnings != 0 {
            let detector = Detector::Warning(actuation.warnings);
            self.detect(detector, tick, Reaction::Tolerated);
        }
        if actuation.mode == Mode::Starting {
            let detector = Detector::Vehicle(Status::WrongSequence);
            self.detect(detector, tick + 1, Reaction::Restart);
        }
    }

    fn detect(&mut self, detector: Detector, tick: u32, reaction: Reaction) {
        let latency_ticks = tick.saturating_sub(self.injected_tick);
        self.detection.get_or_insert(Detection {
            detector,
            latency_ticks,
        });
        if matches!(self.reaction, Reaction::None | Reaction::Tolerated) {
            self.reaction = reaction;
        }
    }

    /// The firmware ended with an exit code before the vehicle's next PWM period.
    pub fn ended(&mut self, exit_code: i32, vehicle: &VehicleNode) {
        let tick = vehicle.periods().div_ceil(self.periods_per_tick);
        self.reaction = Reaction::None;
        self.detect(Detector::Firmware(exit_code), tick, Reaction::Ended);
    }

    /// The ECU stopped sending, between two packets or within one: the servo keeps its last duty,
    /// and the vehicle misses the frame of the next control tick and all later ones.
    pub fn timed_out(&mut self, vehicle: &VehicleNode) {
        let tick = vehicle.periods() / self.periods_per_tick + 1;
        self.reaction = Reaction::None;
        self.detect(
            Detector::Vehicle(Status::NoNewData),
            tick,
            Reaction::LinkLost,
        );
    }

    /// The outcome; `is_value_corrupted` if a corrupted value is still in use.
    pub fn outcome(&self, is_value_corrupted: bool) -> Outcome {
        let verdict = match self.reaction {
            Reaction::SafeState | Reaction::Restart | Reaction::Ended | Reaction::LinkLost => {
                Verdict::Detected
            }
            Reaction::Tolerated => Verdict::Tolerated,
            Reaction::None if self.differs || is_value_corrupted => Verdict::Undetected,
            Reaction::None => Verdict::NoEffect,
        };
        Outcome {
            verdict,
            detection: self.detection,
            reaction: self.reaction,
            peaks: self.peaks,
        }
    }
}

fn actuation(packet: &Packet) -> Option<Actuation<f32>> {
    decode_actuation(packet.frame.as_ref()?).ok()
}

fn commands(actuation: Option<&Actuation<f32>>) -> Option<(Mode, u32, u32, u32, bool)> {
    actuation.map(|actuation| {
        (
            actuation.mode,
            actuation.motor_voltage_v.to_bits(),
            actuation.dither_amplitude_v.to_bits(),
            actuation.wheel_speed_limit_rpm.to_bits(),
            actuation.bridge_on,
        )
    })
}
