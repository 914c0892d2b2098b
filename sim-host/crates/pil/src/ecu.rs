//! The ECU in the loop: model (MIL), software (SIL) or processor (PIL).

use qemu::bus_session::{BusSession, Period};
use qemu::periods::Periods;
use qemu::session::Session;
use qemu::{Finished, RunError};
use shared_model::bus::Message;
use shared_model::controller::{Command, Controller};
use shared_model::dither::Oscillator;
use shared_model::e2e::Sender;
use shared_model::e2e_state_machine::{ProfileStatus, State, StateMachine};
use shared_model::ecu::Warning;
use shared_model::exchange::{FrameBytes, Packet, ToEcu};
use shared_model::frame::{
    ACTUATOR_DATA_ID, SENSOR_STATE_MACHINE, challenge_echo, decode_measurement, encode_actuation,
};
use shared_model::freshness::Challenger;
use shared_model::gate::{Fault, Limiter, Observation, Setpoint, Supervisor};
use shared_model::servo::Pwm;
use shared_model::signal::{Actuation, Measurement, Mode};
use shared_model::{InvalidScenario, Real, Scenario, ecu};
use std::collections::VecDeque;

/// Rate of an ideal clock, Hz.
pub(crate) const CLOCK_HZ: u32 = 25_000_000;

/// An ECU in the loop.
pub trait Ecu {
    /// One PWM period: `answer` takes the ECU's packet and returns the inputs of its pins at the
    /// end of the period.
    ///
    /// # Errors
    /// If the ECU does not answer.
    fn period(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError>;
}

pub(crate) fn counts_per_tick<T: Real>(scenario: &Scenario<T>) -> u32 {
    (f64::from(CLOCK_HZ) / scenario.run.control_rate_hz.to_f64()) as u32
}

/// Model in the loop: controller and gate are called directly, in one channel and one thread,
/// without the ECU's tasks and without the end-to-end check of the sensor frames: every frame is
/// taken as whole, and only its freshness is checked. It verifies that tasks, channels and frames do
/// not change the commands.
pub struct Model<T: Real> {
    controller: Controller<T>,
    supervisor: Supervisor<T>,
    limiter: Limiter<T>,
    oscillator: Oscillator,
    pwm: Pwm<T>,
    challenger: Challenger,
    state_machine: StateMachine,
    measurement: Option<Measurement<T>>,
    /// Counter of the last frame that was used.
    counter: u8,
    now: Setpoint<T>,
    next: Option<Next<T>>,
    bridge_on: bool,
    sender: Sender,
    counts_per_tick: u32,
    periods_per_tick: u32,
    periods: u32,
}

/// Result of a control tick, which takes effect from the next one on.
#[derive(Clone, Copy)]
struct Next<T> {
    setpoint: Setpoint<T>,
    bridge_on: bool,
    frame: FrameBytes,
}

impl<T: Real> Model<T> {
    /// Controller and gate of a scenario.
    ///
    /// # Errors
    /// If the scenario is invalid.
    pub fn new(scenario: &Scenario<T>) -> Result<Self, InvalidScenario> {
        scenario.validate()?;
        let pwm = Pwm::new(&scenario.servo, scenario.run.pwm_rate_hz);
        Ok(Self {
            controller: Controller::new(scenario),
            supervisor: Supervisor::new(scenario, CLOCK_HZ),
            limiter: Limiter::new(scenario, pwm.neutral().code()),
            oscillator: Oscillator::new(&scenario.dither, scenario.run.pwm_rate_hz),
            pwm,
            challenger: Challenger::new(),
            state_machine: StateMachine::new(),
            measurement: None,
            counter: u8::MAX,
            now: Setpoint::neutral(),
            next: None,
            bridge_on: true,
            sender: Sender::new(ACTUATOR_DATA_ID),
            counts_per_tick: counts_per_tick(scenario),
            periods_per_tick: scenario.periods_per_tick(),
            periods: 0,
        })
    }

    fn tick(&mut self, frame: Option<FrameBytes>) -> Next<T> {
        let age_ticks = frame
            .and_then(|frame| self.challenger.age_ticks(challenge_echo(&frame)))
            .filter(|&age_ticks| age_ticks <= self.supervisor.frame_age_ticks());
        let status = match (frame, age_ticks) {
            (None, _) => ProfileStatus::NoNewData,
            (Some(_), None) => ProfileStatus::Error,
            (Some(_), Some(_)) => ProfileStatus::Ok,
        };
        let state = self.state_machine.check(&SENSOR_STATE_MACHINE, status);
        let used = frame.filter(|_| age_ticks.is_some() && state == State::Valid);
        let new = used.map(|frame| decode_measurement(&frame).map(&|x| T::from_f64(x.into())));
        self.counter = used.map_or(self.counter, |[_, _, counter, ..]| counter);
        let mut found_outside = self.limiter.faults();
        let is_active = self.supervisor.mode() == Mode::Active;
        found_outside.add_if(state == State::Invalid && is_active, Fault::FramesInvalid);
        self.measurement = new.filter(Measurement::is_finite).or(self.measurement);
        let is_new = new.is_some_and(|new| new.is_finite());
        let command = self.measurement.map_or(Command::neutral(), |measurement| {
            self.controller.run(&measurement, is_new)
        });
        let setpoint = self.supervisor.run(&Observation {
            elapsed_counts: self.counts_per_tick,
            measurement: new,
            measurement_age_ticks: age_ticks.unwrap_or(0),
            motor_v: command.motor_v,
            feedback_v: command.feedback_v,
            dither_amplitude_v: command.dither_amplitude_v,
            found_outside,
        });
        let is_overspeed = new.is_some_and(|now| self.supervisor.is_overspeed(&now));
        let warning = |warning: Warning, is_found| if is_found { warning.bit() } else { 0 };
        let actuation = Actuation {
            mode: self.supervisor.mode(),
            faults: self.supervisor.faults().bits(),
            motor_voltage_v: setpoint.motor_v.to_f64() as f32,
            dither_amplitude_v: setpoint.dither_amplitude_v.to_f64() as f32,
            wheel_speed_limit_rpm: self.supervisor.wheel_speed_limit_rpm().to_f64() as f32,
            warnings: warning(Warning::FrameMissing, frame.is_none())
                | warning(Warning::FrameStale, status == ProfileStatus::Error)
                | warning(Warning::Overspeed, is_overspeed),
            sensor_counter: self.counter,
            bridge_on: self.supervisor.bridge_on() && self.has_bridge_on(),
            challenge: self.challenger.challenge(),
        };
        Next {
            setpoint,
            bridge_on: self.supervisor.bridge_on(),
            frame: encode_actuation(&actuation, &mut self.sender),
        }
    }

    fn has_bridge_on(&self) -> bool {
        self.bridge_on && !self.limiter.faults().contains(Fault::Readback)
    }
}

impl<T: Real> Ecu for Model<T> {
    fn period(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError> {
        self.periods += 1;
        let is_tick = self.periods.is_multiple_of(self.periods_per_tick);
        let sample: T = self.oscillator.sample();
        let dither_v = self.now.dither_amplitude_v * sample;
        let duty = self.pwm.duty(self.limiter.run(&self.now, dither_v));
        self.limiter.expect(duty.code());
        self.bridge_on = self.has_bridge_on();
        let next = self.next.take_if(|_| is_tick);
        let reply = answer(&Packet {
            duty_code: duty.code(),
            bridge_on: self.bridge_on,
            frame: next.map(|next| next.frame),
        });
        if let Some(next) = next {
            self.now = next.setpoint;
            self.bridge_on &= next.bridge_on;
        }
        self.limiter.observe(reply.duty_code);
        if is_tick {
            self.next = Some(self.tick(reply.frame));
        }
        Ok(())
    }
}

/// Software in the loop: the ECU's program on the host, in the target's arithmetic.
pub struct Software {
    ecu: ecu::Ecu<f32>,
    counts_per_tick: u32,
}

impl Software {
    /// The program of a scenario.
    ///
    /// # Errors
    /// If the scenario is invalid.
    pub fn new(scenario: &Scenario<f32>) -> Result<Self, InvalidScenario> {
        Ok(Self {
            ecu: ecu::Ecu::new(scenario, CLOCK_HZ)?,
            counts_per_tick: counts_per_tick(scenario),
        })
    }
}

impl Ecu for Software {
    fn period(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError> {
        self.ecu.period(answer, || self.counts_per_tick);
        Ok(())
    }
}

/// Processor in the loop: the firmware in the emulator.
pub struct Processor {
    session: Session,
    costs: Vec<(u16, u16)>,
}

impl Processor {
    /// The firmware of a new session.
    pub fn new(session: Session) -> Self {
        Self {
            session,
            costs: Vec::new(),
        }
    }

    /// Counts of the PWM task (the maximum of one period) and of the control task, one pair per
    /// control tick.
    pub fn costs(&self) -> &[(u16, u16)] {
        &self.costs
    }

    /// Ends the run and the firmware.
    ///
    /// # Errors
    /// If it does not end.
    pub fn finish(mut self) -> Result<Finished, RunError> {
        let received = self.session.receive()?;
        self.session.send(&ToEcu {
            packet: received.packet,
            stop: true,
        })?;
        self.session.finish()
    }
}

impl Ecu for Processor {
    fn period(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError> {
        let received = self.session.receive()?;
        if received.packet.frame.is_some() {
            self.costs.push((received.pwm_cost, received.control_cost));
        }
        let packet = answer(&received.packet);
        self.session.send(&ToEcu {
            packet,
            stop: false,
        })
    }
}

/// Processor in the loop on the product's image: a sensor frame in and an actuator frame out over
/// the bus once per control tick. The duty codes are read from the emulated PWM.
pub struct OnBus {
    session: BusSession,
    /// PWM periods that are not yet in a packet: those of the next tick, because the PWM interrupt
    /// preempts the control task.
    periods: VecDeque<Period>,
    periods_per_tick: u32,
    /// Packets of the tick, not yet passed on.
    packets: Periods<Packet>,
}

impl OnBus {
    /// The firmware of a new session, with that many PWM periods per control tick.
    pub fn new(session: BusSession, periods_per_tick: u32) -> Self {
        Self {
            session,
            periods: VecDeque::new(),
            periods_per_tick,
            packets: Periods::default(),
        }
    }

    /// The session.
    pub fn session(&mut self) -> &mut BusSession {
        &mut self.session
    }

    /// Ends the run and returns the firmware's log.
    ///
    /// # Errors
    /// If the emulator does not answer.
    pub fn finish(mut self) -> Result<Vec<String>, RunError> {
        self.session.log()
    }
}

impl Ecu for OnBus {
    fn period(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError> {
        let next = self
            .packets
            .next_or(|| tick(&mut self.session, &mut self.periods, self.periods_per_tick))?;
        // A tick has at least one period.
        let reply = answer(&next.unwrap_or(Packet {
            duty_code: 0,
            bridge_on: false,
            frame: None,
        }));
        match reply.frame {
            Some(frame) => self.session.send(Message::Sensor, &frame),
            None => Ok(()),
        }
    }
}

/// Runs the ECU to the end of a tick and returns its packets. The frame is due with the last.
fn tick(
    session: &mut BusSession,
    periods: &mut VecDeque<Period>,
    periods_per_tick: u32,
) -> Result<Vec<Packet>, RunError> {
    let tick = session.tick()?;
    periods.extend(tick.periods);
    let mut packets: Vec<Packet> = (0..periods_per_tick)
        .map(|_| {
            // A tick has all its periods; after a reset the first has fewer.
            let period = periods.pop_front().unwrap_or_default();
            Packet {
                duty_code: period.duty_code,
                bridge_on: period.bridge_on,
                frame: None,
            }
        })
        .collect();
    if let Some(last) = packets.last_mut() {
        last.frame = tick.frames.last().copied();
    }
    Ok(packets)
}
