//! nRF52840-DK: nRF52840 (Cortex-M4F). It builds and passes the proofs of the link; it has not run.
//!
//! PWM0, on pin P0.03, is the servo's PWM, P0.04 enables its bridge. TIMER1 counts the cost of the
//! tasks. The UART, on P0.06 and P0.08, is the bus: the board's debugger has it as a serial port.
//!
//! The core runs at 64 MHz and the PWM at 16 MHz, from the same oscillator.
//!
//! The PWM reads its duty from RAM at the start of each period, and no register shows it: the
//! readback here finds a duty that the program did not write, and no fault of the PWM itself. The
//! neutral duty is taken over at the end of a period, not at once.

use super::{Board, BoardError, systick};
use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, AtomicU16, Ordering};
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{ErrorType, SetDutyCycle};
use nrf52840_pac as pac;
use shared_model::diagnostic::ResetCause;
use shared_model::independent_clock::IndependentClock;

/// Clock of PWM and timers, Hz.
const TIMER_CLOCK_HZ: u32 = 16_000_000;
/// Clock of core and SysTick, Hz.
const CORE_CLOCK_HZ: u32 = 64_000_000;
const CORE_CLOCKS_PER_COUNT: u32 = CORE_CLOCK_HZ / TIMER_CLOCK_HZ;
/// Clock of the watchdog, Hz.
const LOW_SPEED_HZ: u64 = 32_768;

/// Pins of port 0.
const PWM_PIN: usize = 3;
const BRIDGE_PIN: usize = 4;
const SEND_PIN: usize = 6;
const RECEIVE_PIN: usize = 8;
/// A pin's configuration: output, input disconnected; input.
const OUTPUT: u32 = 0b11;
const INPUT: u32 = 0;
/// An output that no pin has.
const DISCONNECTED: u32 = 1 << 31;

/// Periods that the PWM can have, counts.
const PERIODS: core::ops::RangeInclusive<u16> = 3..=0x7FFF;
/// Bit of a duty in RAM: high from the start of the period for as many counts.
const HIGH_FIRST: u16 = 1 << 15;

const UART_ON: u32 = 4;
const BAUD_1M: u32 = 0x1000_0000;
/// Interrupts of the UART: received byte, sent byte, error.
const RECEIVED: u32 = 1 << 2;
const SENT: u32 = 1 << 7;
const ERROR: u32 = 1 << 9;
const ALL_ERRORS: u32 = 0b1111;

/// Feeds the watchdog.
const FEED: u32 = 0x6E52_4635;
/// The watchdog runs while the core sleeps, and stops with it in the debugger.
const RUN_IN_SLEEP: u32 = 1;

/// The duty that the PWM reads.
static DUTY: AtomicU16 = AtomicU16::new(HIGH_FIRST);
/// A byte has been sent since the start.
static HAS_SENT: AtomicBool = AtomicBool::new(false);

/// The board.
pub struct Nrf52840Dk;

/// PWM0.
pub struct Pwm {
    period: u16,
}

/// The enable pin of the bridge.
pub struct Bridge {
    _only_one: (),
}

fn pwm() -> &'static pac::pwm0::RegisterBlock {
    // SAFETY: only this module uses the PWM, by writes each of which is right at any time.
    unsafe { &*pac::PWM0::ptr() }
}

fn uart() -> &'static pac::uart0::RegisterBlock {
    // SAFETY: only this module uses the UART, in its interrupt after it was opened.
    unsafe { &*pac::UART0::ptr() }
}

fn pins() -> &'static pac::p0::RegisterBlock {
    // SAFETY: only this module uses the port, by writes that change one pin alone.
    unsafe { &*pac::P0::ptr() }
}

/// Puts a duty where the PWM reads it, and makes it read.
fn set_duty(duty: u16) {
    DUTY.store(duty | HIGH_FIRST, Ordering::Release);
    cortex_m::asm::dmb();
    start_task(&pwm().tasks_seqstart[0]);
}

fn start_task(task: &pac::pwm0::TASKS_SEQSTART) {
    // SAFETY: a task takes a one.
    task.write(|w| unsafe { w.bits(1) });
}

impl ErrorType for Pwm {
    type Error = Infallible;
}

impl SetDutyCycle for Pwm {
    fn max_duty_cycle(&self) -> u16 {
        self.period
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        set_duty(duty.min(self.period));
        Ok(())
    }
}

impl digital::ErrorType for Bridge {
    type Error = Infallible;
}

impl OutputPin for Bridge {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Nrf52840Dk::disable_bridge();
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        // SAFETY: a write that changes one pin alone.
        pins().outset.write(|w| unsafe { w.bits(1 << BRIDGE_PIN) });
        Ok(())
    }
}

impl Board for Nrf52840Dk {
    type Pwm = Pwm;
    type Bridge = Bridge;

    const NAME: &str = "nrf52840dk";
    const TIMER_CLOCK_HZ: u32 = TIMER_CLOCK_HZ;
    const CORE_CLOCK_HZ: u32 = CORE_CLOCK_HZ;
    const COST_CLOCK_HZ: u32 = TIMER_CLOCK_HZ;
    const INSTRUCTION_RATE_HZ: u32 = 0;
    /// RTC0 with the low-speed RC oscillator.
    const INDEPENDENT_CLOCK: IndependentClock = IndependentClock {
        nominal_hz: 32_768,
        least_hz: 31_130,
        most_hz: 34_406,
        bits: 24,
    };
    const UART_INTERRUPTS: &[u16] = &[pac::Interrupt::UARTE0_UART0 as u16];

    fn reset_cause() -> ResetCause {
        // SAFETY: nothing else uses the register.
        let power = unsafe { &*pac::POWER::ptr() };
        let flags = power.resetreas.read();
        // SAFETY: ones clear the flags.
        power.resetreas.write(|w| unsafe { w.bits(flags.bits()) });
        if flags.dog().is_detected() {
            ResetCause::Watchdog
        } else if flags.sreq().is_detected() {
            ResetCause::Program
        } else if flags.resetpin().is_detected() {
            ResetCause::Pin
        } else if flags.bits() == 0 {
            ResetCause::Power
        } else {
            ResetCause::Unknown
        }
    }

    fn start_pwm(period: u16) -> Result<(Pwm, Bridge), BoardError> {
        if !PERIODS.contains(&period) {
            return Err(BoardError);
        }
        let mut core = cortex_m::Peripherals::take().ok_or(BoardError)?;
        // SAFETY: nothing else uses the timer.
        let timer = unsafe { &*pac::TIMER1::ptr() };
        let pwm = pwm();
        // SAFETY: values that the registers take, the PWM's before it is on.
        unsafe {
            timer.bitmode.write(|w| w.bits(3));
            timer.prescaler.write(|w| w.bits(0));
            timer.tasks_start.write(|w| w.bits(1));

            pins().pin_cnf[PWM_PIN].write(|w| w.bits(OUTPUT));
            pins().pin_cnf[BRIDGE_PIN].write(|w| w.bits(OUTPUT));
            pwm.psel.out[0].write(|w| w.bits(PWM_PIN as u32));
            for output in &pwm.psel.out[1..] {
                output.write(|w| w.bits(DISCONNECTED));
            }
            pwm.prescaler.write(|w| w.bits(0));
            pwm.mode.write(|w| w.bits(0));
            pwm.countertop.write(|w| w.bits(period.into()));
            // One duty for all outputs, one of them in the sequence, played once.
            pwm.decoder.write(|w| w.bits(0));
            pwm.loop_.write(|w| w.bits(0));
            pwm.seq0.ptr.write(|w| w.bits(DUTY.as_ptr() as u32));
            pwm.seq0.cnt.write(|w| w.bits(1));
            pwm.seq0.refresh.write(|w| w.bits(0));
            pwm.seq0.enddelay.write(|w| w.bits(0));
            pwm.enable.write(|w| w.bits(1));
        }
        Self::neutralise_pwm();
        // Right after the start of a period, so that the interrupt writes a duty early in a period
        // and it is taken over at that period's end, never ambiguous between two.
        systick::start(&mut core.SYST, u32::from(period) * CORE_CLOCKS_PER_COUNT);
        Ok((Pwm { period }, Bridge { _only_one: () }))
    }

    fn disable_bridge() {
        // SAFETY: a write that changes one pin alone. Before the start the pin is an input: the
        // bridge's pull-down has it.
        pins().outclr.write(|w| unsafe { w.bits(1 << BRIDGE_PIN) });
    }

    /// At the end of the period, as the PWM cannot be made to read its duty at once.
    fn neutralise_pwm() {
        let (_, neutral) = Self::pwm_output();
        set_duty(neutral);
    }

    fn pwm_output() -> (u16, u16) {
        let period = pwm().countertop.read().bits() as u16;
        (DUTY.load(Ordering::Relaxed) & !HIGH_FIRST, period / 2)
    }

    fn cost_counter() -> u32 {
        // SAFETY: nothing else uses the timer. An interrupt between the two leaves a later count,
        // which is as good.
        let timer = unsafe { &*pac::TIMER1::ptr() };
        // SAFETY: a task takes a one.
        timer.tasks_capture[0].write(|w| unsafe { w.bits(1) });
        timer.cc[0].read().bits()
    }

    fn start_independent_counter() {
        // SAFETY: nothing else uses the counter and the low-speed clock.
        let (clock, counter) = unsafe { (&*pac::CLOCK::ptr(), &*pac::RTC0::ptr()) };
        // SAFETY: values that the registers take; the RC oscillator is the source after a reset.
        unsafe {
            clock.tasks_lfclkstart.write(|w| w.bits(1));
            counter.prescaler.write(|w| w.bits(0));
            counter.tasks_start.write(|w| w.bits(1));
        }
    }

    fn independent_counter() -> u32 {
        // SAFETY: a read of the counter, without side effect.
        unsafe { (*pac::RTC0::ptr()).counter.read().bits() }
    }

    /// It can only reset: its interrupt comes 61 us before, and is not used.
    fn start_watchdog(timeout_ms: u32) {
        // SAFETY: nothing else uses the watchdog.
        let watchdog = unsafe { &*pac::WDT::ptr() };
        let counts = u64::from(timeout_ms) * LOW_SPEED_HZ / 1000;
        // SAFETY: values that the registers take before the start.
        unsafe {
            watchdog.config.write(|w| w.bits(RUN_IN_SLEEP));
            watchdog.crv.write(|w| w.bits(counts as u32));
            watchdog.rren.write(|w| w.bits(1));
            watchdog.tasks_start.write(|w| w.bits(1));
        }
    }

    fn feed_watchdog() {
        // SAFETY: a write of the key to the one register that was enabled.
        unsafe { (*pac::WDT::ptr()).rr[0].write(|w| w.bits(FEED)) };
    }

    fn open_uart() {
        let uart = uart();
        // SAFETY: nothing else uses the clocks.
        let clock = unsafe { &*pac::CLOCK::ptr() };
        // SAFETY: values that the registers take.
        unsafe {
            // The crystal: the oscillator after a reset is up to 8 % off, too much for a UART. The
            // chip changes over by itself when it runs.
            clock.tasks_hfclkstart.write(|w| w.bits(1));
            pins().outset.write(|w| w.bits(1 << SEND_PIN));
            pins().pin_cnf[SEND_PIN].write(|w| w.bits(OUTPUT));
            pins().pin_cnf[RECEIVE_PIN].write(|w| w.bits(INPUT));
            uart.psel.txd.write(|w| w.bits(SEND_PIN as u32));
            uart.psel.rxd.write(|w| w.bits(RECEIVE_PIN as u32));
            uart.psel.rts.write(|w| w.bits(DISCONNECTED));
            uart.psel.cts.write(|w| w.bits(DISCONNECTED));
            uart.baudrate.write(|w| w.bits(BAUD_1M));
            uart.config.write(|w| w.bits(0));
            uart.intenset.write(|w| w.bits(RECEIVED | ERROR));
            uart.enable.write(|w| w.bits(UART_ON));
            uart.tasks_startrx.write(|w| w.bits(1));
            uart.tasks_starttx.write(|w| w.bits(1));
        }
    }

    fn uart_receive() -> Option<u8> {
        let uart = uart();
        let has_error = uart.events_error.read().bits() != 0;
        if has_error {
            // SAFETY: clears the event, and with ones the flags of the errors.
            unsafe {
                uart.events_error.write(|w| w.bits(0));
                uart.errorsrc.write(|w| w.bits(ALL_ERRORS));
            }
        }
        if uart.events_rxdrdy.read().bits() == 0 {
            return None;
        }
        // Before the byte is taken, because the next one sets it again.
        // SAFETY: clears the event.
        uart.events_rxdrdy.write(|w| unsafe { w.bits(0) });
        let byte = uart.rxd.read().bits() as u8;
        (!has_error).then_some(byte)
    }

    fn uart_send(byte: u8) -> bool {
        let uart = uart();
        let has_room = !HAS_SENT.load(Ordering::Relaxed) || uart.events_txdrdy.read().bits() != 0;
        if has_room {
            HAS_SENT.store(true, Ordering::Relaxed);
            // SAFETY: clears the event, then takes a byte.
            unsafe {
                uart.events_txdrdy.write(|w| w.bits(0));
                uart.txd.write(|w| w.bits(byte.into()));
            }
        }
        has_room
    }

    fn uart_interrupt_on_byte(on: bool) {
        interrupt_on(RECEIVED | ERROR, on);
    }

    fn uart_interrupt_on_room(on: bool) {
        interrupt_on(SENT, on);
    }
}

/// Interrupts of the UART on these events, or no more.
fn interrupt_on(events: u32, on: bool) {
    // SAFETY: bits of the mask of interrupts.
    unsafe {
        if on {
            uart().intenset.write(|w| w.bits(events));
        } else {
            uart().intenclr.write(|w| w.bits(events));
        }
    }
}
