//! The task at the PWM rate: dither, gate, duty.

use super::control::ControlOutput;
use super::dual_channel::DualChannel;
use crate::dither::Oscillator;
use crate::gate::{Fault, Faults, Limiter, Setpoint};
use crate::servo::{Duty, Pwm};
use crate::{Real, Scenario};

/// Output of the PWM task at the start of a period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PwmPeriod {
    /// Duty of the period.
    pub duty: Duty,
    /// A control tick is due at its end.
    pub control_due: bool,
    /// The servo's bridge is on in the period. It is off, until restart, from the period on in which
    /// the duty on the pin differs from the commanded one or the channels differ, and after a fault
    /// of the servo's path in the safe state. Without it no voltage is applied, whatever the duty.
    pub bridge_on: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Channel<T> {
    oscillator: Oscillator,
    limiter: Limiter<T>,
    pwm: Pwm<T>,
    setpoint: Setpoint<T>,
    periods_per_tick: u32,
    periods_to_tick: u32,
    bridge_on: bool,
}

impl<T: Real> Channel<T> {
    // In line, twice: its results stay in registers.
    #[inline(always)]
    fn begin(&mut self) -> PwmPeriod {
        let sample: T = self.oscillator.sample();
        let dither_v = self.setpoint.dither_amplitude_v * sample;
        let duty = self.pwm.duty(self.limiter.run(&self.setpoint, dither_v));
        let control_due = self.periods_to_tick <= 1;
        self.periods_to_tick = if control_due {
            self.periods_per_tick
        } else {
            self.periods_to_tick - 1
        };
        self.bridge_on = self.has_bridge_on();
        PwmPeriod {
            duty,
            control_due,
            bridge_on: self.bridge_on,
        }
    }

    #[inline(always)]
    fn has_bridge_on(&self) -> bool {
        self.bridge_on && !self.limiter.faults().contains(Fault::Readback)
    }

    fn accept(&mut self, setpoint: &Setpoint<T>, bridge_on: bool) {
        self.setpoint = *setpoint;
        self.bridge_on &= bridge_on;
    }
}

/// The task at the PWM rate.
#[derive(Debug, Clone)]
pub struct PwmTask<T> {
    channels: DualChannel<Channel<T>>,
    neutral: Duty,
    faults: Faults,
}

impl<T: Real> PwmTask<T> {
    /// The task of a valid scenario, the servo neutral.
    pub(super) fn new(scenario: &Scenario<T>) -> Self {
        let run = &scenario.run;
        let pwm = Pwm::new(&scenario.servo, run.pwm_rate_hz);
        let neutral = pwm.neutral();
        let periods_per_tick = scenario.periods_per_tick();
        Self {
            channels: DualChannel::new(Channel {
                oscillator: Oscillator::new(&scenario.dither, run.pwm_rate_hz),
                limiter: Limiter::new(scenario, neutral.code()),
                pwm,
                setpoint: Setpoint::neutral(),
                periods_per_tick,
                periods_to_tick: periods_per_tick,
                bridge_on: true,
            }),
            neutral,
            faults: Faults::NONE,
        }
    }

    /// Begins a PWM period.
    pub fn begin(&mut self) -> PwmPeriod {
        let [a, b] = self.channels.both();
        let (a, b) = (a.begin(), b.begin());
        let agree = a == b;
        self.note_channels(agree);
        // Where the channels differ: of the two the duty nearer to neutral, and neutral itself if
        // they lie on both sides of it.
        let duty = self.neutral.median(a.duty, b.duty);
        self.channels
            .run(|channel| channel.limiter.expect(duty.code()));
        PwmPeriod {
            duty,
            control_due: a.control_due || b.control_due,
            bridge_on: agree && a.bridge_on,
        }
    }

    /// Where the channels differ, memory was changed: the bridge is switched off.
    #[inline(always)]
    fn note_channels(&mut self, agree: bool) {
        if !agree {
            self.faults |= Fault::ChannelsDiffer;
            self.channels.run(|channel| channel.bridge_on = false);
        }
    }

    /// Whether the servo's bridge is on from the next period on. Both channels must agree to that.
    pub fn bridge_on(&self) -> bool {
        self.channels.get().iter().all(Channel::has_bridge_on)
    }

    /// Takes over what the control task computed in the last tick; for use where a control tick is
    /// due.
    pub fn accept(&mut self, output: &ControlOutput<T>) {
        let [a, b] = self.channels.both();
        let [for_a, for_b] = &output.setpoints;
        let [bridge_of_a, bridge_of_b] = output.bridge_on;
        a.accept(for_a, bridge_of_a);
        b.accept(for_b, bridge_of_b);
    }

    /// Reports that the control task was not finished when due again.
    pub fn report_late_control(&mut self) {
        self.faults |= Fault::ControlLate;
    }

    /// Ends a PWM period with the duty code that the servo's pin showed.
    pub fn end(&mut self, captured_code: u16) {
        self.channels
            .run(|channel| channel.limiter.observe(captured_code));
    }

    /// All faults found since the start; compares the channels in full.
    // Out of line: nine periods in ten go without it.
    #[inline(never)]
    pub fn faults(&mut self) -> Faults {
        self.note_channels(self.channels.agrees());
        for found in self.channels.run(|channel| channel.limiter.faults()) {
            self.faults |= found;
        }
        self.faults
    }

    /// The duty of no voltage.
    pub fn neutral(&self) -> Duty {
        self.neutral
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dither::Waveform;

    const SETPOINT: Setpoint<f32> = Setpoint {
        motor_v: 3.0,
        dither_amplitude_v: 0.1,
    };

    fn scenario() -> Scenario<f32> {
        let mut scenario = Scenario::reconstruction();
        scenario.dither.waveform = Waveform::Square;
        scenario
    }

    /// A running task with one channel damaged.
    fn damaged(channel: usize, damage: impl Fn(&mut Channel<f32>)) -> PwmTask<f32> {
        let mut task = PwmTask::new(&scenario());
        let mut place = 0;
        task.channels.run(|one| {
            one.setpoint = SETPOINT;
            if place == channel {
                damage(one);
            }
            place += 1;
        });
        task
    }

    /// Until then the duty is neutral, the right one, or between them, and no control tick is late.
    fn assert_found(damage: impl Fn(&mut Channel<f32>), what: &str) {
        for channel in [0, 1] {
            let mut right = damaged(2, |_| {});
            let mut wrong = damaged(channel, &damage);
            for _ in 0..50 {
                let (right, wrong) = (right.begin(), wrong.begin());
                let neutral = right.duty.period() / 2;
                assert!(
                    (neutral..=right.duty.code()).contains(&wrong.duty.code()),
                    "{what}"
                );
                assert!(wrong.control_due || !right.control_due, "{what}");
            }
            assert_eq!(right.faults(), Faults::NONE);
            assert!(wrong.faults().contains(Fault::ChannelsDiffer), "{what}");
        }
    }

    #[test]
    fn every_flipped_bit_of_a_channel_is_found_and_harmless() {
        for bit in 0..32 {
            let flip = |number: f32| f32::from_bits(number.to_bits() ^ (1 << bit));
            let mut bus = scenario();
            bus.servo.bus_voltage_v = flip(bus.servo.bus_voltage_v);
            let pwm = Pwm::new(&bus.servo, 10_000.0);
            assert_found(|one| one.pwm = pwm, "bus voltage");

            let mut frequency = scenario();
            frequency.dither.square_frequency_rad_per_s = flip(2000.0);
            let oscillator = Oscillator::new(&frequency.dither, 10_000.0);
            if oscillator != Oscillator::new(&scenario().dither, 10_000.0) {
                assert_found(|one| one.oscillator = oscillator, "dither frequency");
            }
            assert_found(|one| one.setpoint.motor_v = flip(3.0), "motor's share");
            assert_found(
                |one| one.setpoint.dither_amplitude_v = flip(0.1),
                "amplitude",
            );
            assert_found(|one| one.periods_per_tick ^= 1 << bit, "periods per tick");
            assert_found(|one| one.periods_to_tick ^= 1 << bit, "periods to the tick");
        }
    }
}
