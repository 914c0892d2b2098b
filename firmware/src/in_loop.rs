//! The ECU in the loop: sensor frames come over the link, duty codes and actuator frames go out on it, and the host moves the
//! vehicle in between.

use crate::board::{Board, Current};
use crate::exit::ExitCode;
use crate::link::{Link, Pace};
use crate::{app, fault, tasks};
use core::cell::Cell;
use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use critical_section::Mutex;
use embedded_hal::pwm::SetDutyCycle;
use shared_model::Scenario;
use shared_model::ecu::{ControlInput, ControlOutput, ControlTask, Ecu, PwmTask};
use shared_model::exchange::{FrameBytes, Packet, ToHost};

/// From the PWM interrupt to the control task.
static INPUT: Mutex<Cell<ControlInput>> = Mutex::new(Cell::new(ControlInput::NOTHING));
/// From the control task to the PWM interrupt.
static OUTPUT: Mutex<Cell<Option<ControlOutput<f32>>>> = Mutex::new(Cell::new(None));
static CONTROL_COST: AtomicU16 = AtomicU16::new(0);
static CONTROL_TICKS: AtomicU32 = AtomicU32::new(0);

/// What the PWM interrupt works on.
pub struct PwmInterrupt {
    /// The program.
    pub task: PwmTask<f32>,
    /// The servo's PWM.
    pub pwm: <Current as Board>::Pwm,
    /// Servo and sensors, which the host stands in for.
    pub link: Link,
    /// The sensor frame that came since the last control tick.
    pub frame: Option<FrameBytes>,
    /// The independent clock at the last control tick, counts.
    pub last_tick_counts: u32,
    /// Counts of that clock in a control tick at the host's pace.
    pub nominal_counts: u32,
}

/// What the control interrupt works on.
pub struct ControlInterrupt {
    /// The program.
    pub task: ControlTask<f32>,
}

impl PwmInterrupt {
    /// One PWM period.
    pub fn run(&mut self) {
        let period = self.task.begin();
        // The PWM's period is the duty's, so the code fits; one that is refused is found on the pin.
        let _ = self.pwm.set_duty_cycle(period.duty.code());
        let output = critical_section::with(|cs| {
            period
                .control_due
                .then(|| OUTPUT.borrow(cs).take())
                .flatten()
        });
        if let Some(output) = &output {
            self.task.accept(output);
        }
        let sent = ToHost {
            packet: Packet {
                // As it is on the pin.
                duty_code: Current::pwm_output().0,
                frame: output.map(|output| output.frame),
            },
            pwm_cost: if period.control_due {
                tasks::take_pwm_cost()
            } else {
                0
            },
            control_cost: CONTROL_COST.load(Ordering::Relaxed),
        };
        let Ok(received) = tasks::uncounted(|| self.link.exchange(&sent)) else {
            fault::end_safely(ExitCode::LinkLost);
        };
        if received.stop {
            tasks::finish();
            return;
        }
        self.task.end(received.packet.duty_code);
        self.frame = received.packet.frame.or(self.frame);
        if period.control_due {
            self.call_control();
        }
    }

    fn call_control(&mut self) {
        let now = Current::cost_counter();
        let elapsed_counts = match self.link.pace {
            Pace::Host => self.nominal_counts,
            Pace::Timer => now.wrapping_sub(self.last_tick_counts),
        };
        let input = ControlInput {
            frame: self.frame.take(),
            elapsed_counts,
            found_by_pwm: self.task.faults(),
        };
        self.last_tick_counts = now;
        critical_section::with(|cs| INPUT.borrow(cs).set(input));
        if !tasks::call_control() {
            self.task.report_late_control();
        }
    }
}

impl ControlInterrupt {
    /// One control tick.
    pub fn run(&mut self) {
        let start = Current::cost_counter();
        let input = critical_section::with(|cs| INPUT.borrow(cs).get());
        let output = self.task.run(&input);
        critical_section::with(|cs| OUTPUT.borrow(cs).set(Some(output)));
        let cost = Current::cost_counter().wrapping_sub(start);
        CONTROL_COST.store(tasks::saturate(cost), Ordering::Relaxed);
        CONTROL_TICKS.fetch_add(1, Ordering::Relaxed);
    }
}

/// Steers until the host ends the run.
pub fn run(scenario: &Scenario<f32>, ecu: Ecu<f32>, link: Link) -> ExitCode {
    let period = ecu.pwm.neutral().period();
    let tick_s = 1.0 / scenario.run.control_rate_hz;
    let pace = link.pace;
    app::start(period, scenario, tick_s, |pwm| {
        let pwm = place_pwm(PwmInterrupt {
            task: ecu.pwm,
            pwm,
            link,
            frame: None,
            last_tick_counts: Current::cost_counter(),
            nominal_counts: (Current::COST_CLOCK_HZ as f32 * tick_s) as u32,
        })?;
        let control = place_control(ControlInterrupt { task: ecu.control })?;
        Some((
            tasks::PwmInterrupt::InLoop(pwm),
            tasks::ControlInterrupt::InLoop(control),
        ))
    });
    if pace == Pace::Host {
        Current::stop_pwm_interrupt();
    }
    let mut ticks_seen = 0;
    while !tasks::is_finished() {
        let ticks = CONTROL_TICKS.load(Ordering::Relaxed);
        if ticks != ticks_seen {
            ticks_seen = ticks;
            Current::feed_watchdog();
        }
        match pace {
            Pace::Host => SCB::set_pendst(),
            Pace::Timer => Current::idle(),
        }
    }
    Current::neutralise_pwm();
    app::conclude(0)
}

// Functions of their own, so that the two have names in the image: faults are injected there.
fn place_pwm(interrupt: PwmInterrupt) -> Option<&'static mut PwmInterrupt> {
    cortex_m::singleton!(: PwmInterrupt = interrupt)
}

fn place_control(interrupt: ControlInterrupt) -> Option<&'static mut ControlInterrupt> {
    cortex_m::singleton!(: ControlInterrupt = interrupt)
}
