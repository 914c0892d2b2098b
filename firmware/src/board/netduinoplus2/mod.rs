//! Netduino Plus 2: STM32F405 (Cortex-M4F), on silicon and as QEMU emulates it.
//!
//! TIM3's first channel, on pin PA6, is the servo's PWM, PA7 enables its bridge. TIM2 counts the cost
//! of the tasks. USART1, on PB6 and PB7, is the bus, or CAN1, on PB8 and PB9. All clocks are the 16 MHz of the internal oscillator, which the
//! chip has after a reset: the emulator has no clock controller, so a program that waits for the
//! crystal or the PLL waits for ever.
//!
//! | | silicon | emulator |
//! |---|---|---|
//! | duty | taken over at the next period (preload) | readable in the register at once |
//! | SysTick, timers | 16 MHz | 168 MHz and 1 GHz, whatever the program sets |
//! | watchdog | resets the chip | not there: it reads 0 and never bites |
//! | cost | cycles, as the timer has the core's clock | virtual time |

#[cfg(feature = "can")]
mod can;
mod rtc;

use super::{Board, BoardError, systick};
use fugit::TimerDurationU32;
use shared_model::diagnostic::ResetCause;
use shared_model::independent_clock::IndependentClock;
use stm32f4xx_hal::gpio::{Output, PA7, PushPull};
use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Enable;
use stm32f4xx_hal::timer::{C1, PwmChannel};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// Clock of core, SysTick and timers, Hz.
const CLOCK_HZ: u32 = 16_000_000;

/// 1 Mbit/s.
const UART_DIVIDER: u16 = (CLOCK_HZ / 1_000_000) as u16;

/// Rates in the emulator. It runs with `-icount shift=3`, 8 ns per instruction, and its SysTick at
/// 168 MHz gives the program's second 16/168 s. So an instruction takes 1.3 of the program's
/// clocks, about what a Cortex-M4 takes at 16 MHz, where the flash has no wait states.
mod emulated {
    use super::CLOCK_HZ;

    const SYSTICK_HZ: u64 = 168_000_000;
    const TIMER_HZ: u64 = 1_000_000_000;
    const INSTRUCTION_RATE_HZ: u64 = 125_000_000;

    const fn a_second_of_the_program(rate_hz: u64) -> u32 {
        (rate_hz * CLOCK_HZ as u64 / SYSTICK_HZ) as u32
    }

    pub const COST_CLOCK_HZ: u32 = a_second_of_the_program(TIMER_HZ);
    pub const PROGRAM_INSTRUCTION_RATE_HZ: u32 = a_second_of_the_program(INSTRUCTION_RATE_HZ);
}

/// The board.
pub struct NetduinoPlus2;

impl Board for NetduinoPlus2 {
    type Pwm = PwmChannel<pac::TIM3, C1>;
    type Bridge = PA7<Output<PushPull>>;

    const NAME: &str = "netduinoplus2";
    const TIMER_CLOCK_HZ: u32 = CLOCK_HZ;
    // The reports count instructions in the emulator. On silicon: CLOCK_HZ and 0.
    const COST_CLOCK_HZ: u32 = emulated::COST_CLOCK_HZ;
    const INSTRUCTION_RATE_HZ: u32 = emulated::PROGRAM_INSTRUCTION_RATE_HZ;
    /// The sub-seconds of the RTC with the low-speed oscillator, LSI. QEMU has neither.
    const INDEPENDENT_CLOCK: IndependentClock = IndependentClock {
        nominal_hz: 32_000,
        least_hz: 17_000,
        most_hz: 47_000,
        bits: 15,
    };
    const UART_INTERRUPTS: &[u16] = &[pac::Interrupt::USART1 as u16];

    fn reset_cause() -> ResetCause {
        // SAFETY: a read and a write of the flags' register; nothing else uses them.
        let rcc = unsafe { &*pac::RCC::ptr() };
        let flags = rcc.csr().read();
        let cause = if flags.porrstf().bit() || flags.borrstf().bit() {
            ResetCause::Power
        } else if flags.wdgrstf().bit() || flags.wwdgrstf().bit() {
            ResetCause::Watchdog
        } else if flags.sftrstf().bit() {
            ResetCause::Program
        } else if flags.padrstf().bit() {
            ResetCause::Pin
        } else {
            ResetCause::Unknown
        };
        rcc.csr().modify(|_, w| w.rmvf().set_bit());
        cause
    }

    fn start_pwm(period: u16) -> Result<(Self::Pwm, Self::Bridge), BoardError> {
        let chip = pac::Peripherals::take().ok_or(BoardError)?;
        let mut core = cortex_m::Peripherals::take().ok_or(BoardError)?;
        let mut rcc = chip.RCC.constrain();
        let pins = chip.GPIOA.split(&mut rcc);

        pac::TIM2::enable(&mut rcc);
        chip.TIM2.arr().write(|w| w.arr().set(u32::MAX));
        chip.TIM2.cr1().write(|w| w.cen().enabled());

        let period_ticks = TimerDurationU32::<CLOCK_HZ>::from_ticks(period.into());
        let (_, (channel, ..)) = chip.TIM3.pwm(period_ticks, &mut rcc);
        let mut pwm = channel.with(pins.pa6);
        Self::neutralise_pwm();
        pwm.enable();
        // Right after the restart of the period, so that the interrupt writes a duty early in a
        // period and it is taken over at that period's end, never ambiguous between two.
        systick::start(&mut core.SYST, period.into());
        Ok((pwm, pins.pa7.into_push_pull_output()))
    }

    fn disable_bridge() {
        // SAFETY: a write to a register that changes one pin alone. Without the port's clock, as
        // before the start, it does nothing, and the pin is an input: the bridge's pull-down has it.
        let port = unsafe { &*pac::GPIOA::ptr() };
        port.bsrr().write(|w| w.br7().set_bit());
    }

    fn neutralise_pwm() {
        let (_, neutral) = Self::pwm_output();
        // SAFETY: writes to two registers of the timer, each of which is right at any time.
        let timer = unsafe { &*pac::TIM3::ptr() };
        timer.ccr1().write(|w| w.ccr().set(neutral));
        // Takes the duty over now, and not only when the period is over.
        timer.egr().write(|w| w.ug().update());
    }

    fn pwm_output() -> (u16, u16) {
        // SAFETY: reads of two registers, without side effect.
        let timer = unsafe { &*pac::TIM3::ptr() };
        let period = u32::from(timer.arr().read().arr().bits()) + 1;
        (timer.ccr1().read().ccr().bits(), (period / 2) as u16)
    }

    fn cost_counter() -> u32 {
        // SAFETY: a read of the counter, without side effect.
        unsafe { (*pac::TIM2::ptr()).cnt().read().cnt().bits() }
    }

    fn start_independent_counter() {
        rtc::start();
    }

    fn independent_counter() -> u32 {
        rtc::counter()
    }

    fn start_watchdog(timeout_ms: u32) {
        // SAFETY: nothing else uses the two peripherals.
        let (iwdg, debug) = unsafe { (pac::IWDG::steal(), pac::DBGMCU::steal()) };
        let mut watchdog = IndependentWatchdog::new(iwdg);
        // A debugger that serves semihosting halts the core each time.
        watchdog.stop_on_debug(&debug, true);
        watchdog.start(timeout_ms.millis());
    }

    fn feed_watchdog() {
        // SAFETY: nothing else uses the watchdog.
        IndependentWatchdog::new(unsafe { pac::IWDG::steal() }).feed();
    }

    fn open_uart() {
        // SAFETY: port B and USART1 are used by nothing else, and their clocks by nothing that runs
        // at the same time.
        let (rcc, port, uart) =
            unsafe { (&*pac::RCC::ptr(), &*pac::GPIOB::ptr(), &*pac::USART1::ptr()) };
        rcc.ahb1enr().modify(|_, w| w.gpioben().enabled());
        rcc.apb2enr().modify(|_, w| w.usart1en().enabled());
        port.afrl().modify(|_, w| w.afrl6().af7().afrl7().af7());
        port.moder()
            .modify(|_, w| w.moder6().alternate().moder7().alternate());
        // SAFETY: a divider that the UART takes.
        uart.brr().write(|w| unsafe { w.bits(UART_DIVIDER) });
        uart.cr1().write(|w| {
            let w = w.ue().enabled().te().enabled();
            w.re().enabled().rxneie().enabled()
        });
    }

    fn uart_receive() -> Option<u8> {
        // SAFETY: nothing else uses the UART; reading the data takes the byte out, and clears the
        // errors of the line.
        let uart = unsafe { &*pac::USART1::ptr() };
        let state = uart.sr().read();
        let has_error = state.ore().bit() || state.fe().bit() || state.nf().bit();
        if !(state.rxne().bit() || has_error) {
            return None;
        }
        let byte = uart.dr().read().dr().bits() as u8;
        (!has_error).then_some(byte)
    }

    fn uart_send(byte: u8) -> bool {
        // SAFETY: nothing else uses the UART.
        let uart = unsafe { &*pac::USART1::ptr() };
        let has_room = uart.sr().read().txe().bit_is_set();
        if has_room {
            uart.dr().write(|w| w.dr().set(byte.into()));
        }
        has_room
    }

    fn uart_interrupt_on_byte(on: bool) {
        // SAFETY: nothing else uses the UART.
        let uart = unsafe { &*pac::USART1::ptr() };
        uart.cr1().modify(|_, w| w.rxneie().bit(on));
    }

    fn uart_interrupt_on_room(on: bool) {
        // SAFETY: nothing else uses the UART.
        let uart = unsafe { &*pac::USART1::ptr() };
        uart.cr1().modify(|_, w| w.txeie().bit(on));
    }
}
