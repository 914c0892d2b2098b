//! Requirements on a board: a PWM, a clock for its interrupt, a watchdog, and a counter that
//! measures the tasks.
//!
//! A board is one folder here, with its code and its memory map, and one feature `board-<folder>`.
//! The build takes exactly one. docs/porting.md leads through a port.

#[cfg(feature = "can")]
pub mod rings;
mod systick;

use shared_model::diagnostic::ResetCause;
use shared_model::independent_clock::IndependentClock;

#[cfg(feature = "board-mps2")]
mod mps2;
#[cfg(feature = "board-mps2")]
pub use mps2::Mps2 as Current;

#[cfg(feature = "board-netduinoplus2")]
mod netduinoplus2;
#[cfg(feature = "board-netduinoplus2")]
pub use netduinoplus2::NetduinoPlus2 as Current;

#[cfg(feature = "board-nrf52840dk")]
mod nrf52840dk;
#[cfg(feature = "board-nrf52840dk")]
pub use nrf52840dk::Nrf52840Dk as Current;

#[cfg(feature = "board-nucleog474re")]
mod nucleog474re;
#[cfg(feature = "board-nucleog474re")]
pub use nucleog474re::NucleoG474re as Current;

/// A board. Fault handlers reach all of it but the two `start`s, so nothing here needs a value.
pub trait Board {
    /// The servo's PWM.
    type Pwm: embedded_hal::pwm::SetDutyCycle;
    /// The enable pin of the servo's bridge, high for on: the second way to switch it off.
    type Bridge: embedded_hal::digital::OutputPin;

    /// Name of the board's folder, for which a configuration is made.
    const NAME: &str;
    /// Clock of the PWM's timer, Hz. A scenario whose `servo.timer_clock_hz` is another is refused:
    /// its carrier and all its times would be off by the ratio.
    const TIMER_CLOCK_HZ: u32;
    /// Clock of the core, Hz.
    const CORE_CLOCK_HZ: u32 = Self::TIMER_CLOCK_HZ;
    /// Counts per second of [`cost_counter`](Self::cost_counter).
    const COST_CLOCK_HZ: u32;
    /// Instructions per second of a simulated core; 0 on silicon.
    const INSTRUCTION_RATE_HZ: u32;
    /// The clock of [`independent_counter`](Self::independent_counter).
    const INDEPENDENT_CLOCK: IndependentClock;
    /// Interrupts of the UART. The first is the one that the program may pend.
    const UART_INTERRUPTS: &[u16];

    /// Cause of the last reset. Clears it, so for use once.
    fn reset_cause() -> ResetCause;

    /// Starts the PWM with a period of `period` counts at the neutral duty, and calls the SysTick
    /// exception once per period. The bridge stays off.
    ///
    /// # Errors
    /// If the period does not fit the timer, or the PWM is started already.
    fn start_pwm(period: u16) -> Result<(Self::Pwm, Self::Bridge), BoardError>;

    /// Switches the bridge off. Works at any time and from any handler, also before the PWM is
    /// started.
    fn disable_bridge();

    /// Stops the PWM interrupt; the PWM keeps its duty.
    fn stop_pwm_interrupt() {
        systick::stop();
    }

    /// Puts the PWM to the neutral duty at once. Works at any time and from any handler, also
    /// before it is started.
    fn neutralise_pwm();

    /// Duty code that is on the PWM, and the neutral one; where there are registers, read back from
    /// them.
    fn pwm_output() -> (u16, u16);

    /// A free-running counter, upwards, of 32 bits.
    fn cost_counter() -> u32;

    /// Starts the independent counter.
    fn start_independent_counter();

    /// A free-running counter, upwards, with an oscillator that is not that of the core.
    fn independent_counter() -> u32;

    /// Starts the watchdog. When it is not fed for `timeout_ms`, it raises the non-maskable
    /// interrupt or, where it can only do that, resets the chip, whose pins then leave the
    /// servo's bridge off.
    fn start_watchdog(timeout_ms: u32);

    /// Feeds the watchdog.
    fn feed_watchdog();

    /// Opens the UART of the bus, 8 bits without parity, with its interrupt on received bytes.
    fn open_uart();

    /// Acknowledges the UART's interrupt, where that is not done by reading and writing its data.
    fn uart_acknowledge() {}

    /// The next received byte, if there is one. Clears errors of the line, whose byte is lost.
    fn uart_receive() -> Option<u8>;

    /// Sends a byte if there is room for it now.
    fn uart_send(byte: u8) -> bool;

    /// Interrupts on received bytes, or no more. Called with interrupts masked, or by the UART's own.
    fn uart_interrupt_on_byte(on: bool);

    /// Interrupts also when there is room to send.
    fn uart_interrupt_on_room(on: bool);

    /// Waits until there may be work to do.
    fn idle() {
        cortex_m::asm::wfi();
    }
}

/// A board with a CAN, in its file `can.rs`.
#[cfg(feature = "can")]
pub trait CanBoard: Board {
    /// The product's bus.
    type Bus: shared_model::bus::Bus;

    /// Interrupts of the CAN; none where the control task reads the hardware's own queue.
    const CAN_INTERRUPTS: &[u16];

    /// Opens the CAN; `None` at the second call, or if the controller does not answer.
    fn open_can() -> Option<Self::Bus>;

    /// Moves frames between controller and rings, in one of the interrupts.
    fn can_interrupt();
}

/// The board cannot start its PWM.
#[derive(Debug, Clone, Copy)]
pub struct BoardError;
