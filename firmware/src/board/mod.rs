//! What a board brings: a clock for the PWM interrupt, a PWM, a watchdog, and a counter that measures the tasks.

mod mps2;

/// The board that this image is for.
pub type Current = mps2::Mps2;

/// A board. All of it is reachable from fault handlers, so nothing here needs a value.
pub trait Board {
    /// The servo's PWM.
    type Pwm: embedded_hal::pwm::SetDutyCycle;

    /// Counts a second of [`cost_counter`](Self::cost_counter).
    const COST_CLOCK_HZ: u32;
    /// Instructions a second that the core executes, where it is simulated to execute that many; 0 on silicon.
    const INSTRUCTION_RATE_HZ: u32;

    /// Starts the PWM with a period of `period` counts at the neutral duty, and calls the SysTick exception once a period.
    ///
    /// # Errors
    /// If the period does not fit the timer, or the PWM is started already.
    fn start_pwm(period: u16) -> Result<Self::Pwm, BoardError>;

    /// Stops the PWM interrupt; the PWM keeps its duty.
    fn stop_pwm_interrupt();

    /// Puts the PWM to the neutral duty at once. Works at any time and from any handler, also before it is started.
    fn neutralise_pwm();

    /// Duty code that is on the PWM, and the neutral one.
    fn pwm_output() -> (u16, u16);

    /// A free-running counter, upwards.
    fn cost_counter() -> u32;

    /// Starts the watchdog, which raises the non-maskable interrupt when it is not fed for `timeout_ms`.
    fn start_watchdog(timeout_ms: u32);

    /// Passes time until there may be something to do.
    fn idle();

    /// Feeds the watchdog.
    fn feed_watchdog();

    /// Opens the UART that links a host.
    fn open_uart();

    /// Sends a byte on it, waiting for room.
    fn uart_send(byte: u8);

    /// The next byte from it, if there is one.
    fn uart_receive() -> Option<u8>;

    /// Stops the counter of [`cost_counter`](Self::cost_counter), the watchdog and the PWM interrupt, so that an emulated ECU
    /// can wait for its host without ageing.
    fn pause_time();

    /// Goes on after [`pause_time`](Self::pause_time), the PWM interrupt with a whole period.
    fn resume_time();
}

/// Why a board cannot start its PWM.
#[derive(Debug, Clone, Copy)]
pub struct BoardError;
