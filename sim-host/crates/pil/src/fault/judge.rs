//! Was a fault found, when, and what came of it? Every run is held against its clean twin.

use super::super::drive::Drive;
use serde::Serialize;
use shared_model::e2e::Status;
use shared_model::exchange::Packet;
use shared_model::frame::decode_actuation;
use shared_model::gate::Faults;
use shared_model::signal::{Actuation, Mode};

/// Names of the warnings in an actuator frame, by bit.
const WARNINGS: [&str; 5] = [
    "frame missing",
    "frame damaged",
    "frame repeated",
    "frame sequence",
    "frames lost",
];

/// Who found a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finder {
    /// The ECU's gate, with these faults.
    Gate(Faults),
    /// The ECU, with these bits of warnings.
    Warning(u16),
    /// The vehicle, by an actuator frame that it did not get as it should.
    Vehicle(Status),
    /// The firmware ended with this code, its PWM neutral.
    Firmware(i32),
}

impl Finder {
    /// In words.
    pub fn describe(self) -> String {
        match self {
            Self::Gate(faults) => {
                let names: Vec<_> = faults.iter().map(|fault| fault.name()).collect();
                names.join(" + ")
            }
            Self::Warning(bits) => {
                let set = WARNINGS.iter().enumerate();
                let set = set.filter(|(bit, _)| bits & (1 << bit) != 0);
                let names: Vec<_> = set.map(|(_, name)| *name).collect();
                format!("warning: {}", names.join(" + "))
            }
            Self::Vehicle(status) => format!("vehicle: {status:?}"),
            Self::Firmware(code) => format!("exit code {code}"),
        }
    }
}

/// The first word of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finding {
    /// Who found it.
    pub finder: Finder,
    /// Control ticks from the injection to the one that found it. The ECU's frame that says so leaves one later.
    pub latency_ticks: u32,
}

/// What came of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reaction {
    /// Nothing.
    None,
    /// It was said, and the ECU goes on.
    Tolerated,
    /// The ECU's safe state.
    SafeState,
    /// The ECU started again.
    Restart,
    /// The firmware ended, its PWM neutral.
    Ended,
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
        }
    }
}

/// How a fault is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Trajectory, and the servo brought to neutral or the ECU started again.
    Detected,
    /// Trajectory, and gone on.
    Tolerated,
    /// Not found; the ECU commands what it would have without, bit for bit, and works on no wrong value.
    Harmless,
    /// Not found, and the ECU commands something else or works on a wrong value.
    Silent,
}

/// Greatest angles of the vehicle over a time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Peaks {
    /// Greatest magnitude of the front steering angle, rad.
    pub steering_angle_rad: f64,
    /// Greatest magnitude of the front tyres' slip angle, rad.
    pub front_slip_angle_rad: f64,
}

impl Peaks {
    /// The vehicle's angles now.
    pub fn of(drive: &Drive) -> Self {
        Self {
            steering_angle_rad: drive.plant().truth().steering_angle_rad.abs(),
            front_slip_angle_rad: drive.plant().front_slip_angle_rad().abs(),
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

/// What became of a fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// How it is judged.
    pub verdict: Verdict,
    /// Who found it, if anybody did.
    pub finding: Option<Finding>,
    /// What the ECU did.
    pub reaction: Reaction,
    /// The vehicle's greatest angles from the injection on.
    pub peaks: Peaks,
}

/// Watches a run from the injection on.
#[derive(Debug, Clone)]
pub struct Judge {
    periods_a_tick: u32,
    injected_tick: u32,
    finding: Option<Finding>,
    reaction: Reaction,
    differs: bool,
    peaks: Peaks,
}

impl Judge {
    /// Of a run whose fault begins behind that control tick.
    pub fn new(periods_a_tick: u32, injected_tick: u32) -> Self {
        Self {
            periods_a_tick,
            injected_tick,
            finding: None,
            reaction: Reaction::None,
            differs: false,
            peaks: Peaks::default(),
        }
    }

    /// Looks at a PWM period that is over: what the ECU put out, what it put out in the clean twin, and the vehicle.
    pub fn look(&mut self, from_ecu: &Packet, clean: &Packet, drive: &Drive) {
        self.differs |= from_ecu.duty_code != clean.duty_code;
        let (now, then) = (actuation(from_ecu), actuation(clean));
        self.differs |= commands(now.as_ref()) != commands(then.as_ref());
        let tick = drive.periods() / self.periods_a_tick;
        if let Some(told) = now {
            self.listen(&told, tick.saturating_sub(1));
        }
        if drive.periods().is_multiple_of(self.periods_a_tick) {
            self.peaks = self.peaks.or(Peaks::of(drive));
        }
        let status = drive.frame_status();
        if status != Status::Ok {
            self.found(Finder::Vehicle(status), tick, Reaction::Tolerated);
        }
    }

    fn listen(&mut self, told: &Actuation<f32>, tick: u32) {
        if told.faults != 0 {
            let finder = Finder::Gate(Faults::from_bits(told.faults));
            self.found(finder, tick, Reaction::SafeState);
        }
        if told.warnings != 0 {
            self.found(Finder::Warning(told.warnings), tick, Reaction::Tolerated);
        }
        if told.mode == Mode::Starting {
            let finder = Finder::Vehicle(Status::WrongSequence);
            self.found(finder, tick + 1, Reaction::Restart);
        }
    }

    fn found(&mut self, finder: Finder, tick: u32, reaction: Reaction) {
        let latency_ticks = tick.saturating_sub(self.injected_tick);
        self.finding.get_or_insert(Finding {
            finder,
            latency_ticks,
        });
        if matches!(self.reaction, Reaction::None | Reaction::Tolerated) {
            self.reaction = reaction;
        }
    }

    /// The firmware has ended with an exit code, before the vehicle's next PWM period.
    pub fn ended(&mut self, exit_code: i32, drive: &Drive) {
        let tick = drive.periods().div_ceil(self.periods_a_tick);
        self.reaction = Reaction::None;
        self.found(Finder::Firmware(exit_code), tick, Reaction::Ended);
    }

    /// The ECU puts out nothing any more: the vehicle misses its frames, the servo keeps its last duty.
    pub fn fell_silent(&mut self) {
        self.found(
            Finder::Vehicle(Status::NoNewData),
            self.injected_tick + 1,
            Reaction::Tolerated,
        );
    }

    /// What became of the fault; `stays_wrong` if a wrong value is in use.
    pub fn conclude(&self, stays_wrong: bool) -> Outcome {
        let verdict = match self.reaction {
            Reaction::SafeState | Reaction::Restart | Reaction::Ended => Verdict::Detected,
            Reaction::Tolerated => Verdict::Tolerated,
            Reaction::None if self.differs || stays_wrong => Verdict::Silent,
            Reaction::None => Verdict::Harmless,
        };
        Outcome {
            verdict,
            finding: self.finding,
            reaction: self.reaction,
            peaks: self.peaks,
        }
    }
}

fn actuation(packet: &Packet) -> Option<Actuation<f32>> {
    decode_actuation(packet.frame.as_ref()?).ok()
}

fn commands(actuation: Option<&Actuation<f32>>) -> Option<(Mode, u32, u32, u32)> {
    actuation.map(|told| {
        (
            told.mode,
            told.motor_voltage_v.to_bits(),
            told.dither_amplitude_v.to_bits(),
            told.wheel_speed_limit_rpm.to_bits(),
        )
    })
}
