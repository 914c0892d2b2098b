//! Nucleo-G474RE: STM32G474 (Cortex-M4F). It builds and passes the proofs of the link; no emulator
//! has this chip.
//!
//! TIM3's first channel, on pin PA6, is the servo's PWM, PA7 enables its bridge. TIM2 counts the cost
//! of the tasks. USART1, on PC4 and PC5, is the bus, or FDCAN1, on PB8 and PB9. All clocks are the 16 MHz of the internal oscillator, which the
//! chip has after a reset.

#[cfg(feature = "can")]
mod can;

use super::{Board, BoardError, systick};
use shared_model::diagnostic::ResetCause;
use shared_model::independent_clock::IndependentClock;
use stm32g4xx_hal::gpio::{AF2, Output, PA6, PA7, PushPull};
use stm32g4xx_hal::independent_watchdog::IndependentWatchdog;
use stm32g4xx_hal::prelude::*;
use stm32g4xx_hal::pwm::{ActiveHigh, C1, ComplementaryImpossible, Pwm, PwmAdvExt};
use stm32g4xx_hal::rcc::Enable;
use stm32g4xx_hal::stm32 as pac;
use stm32g4xx_hal::time::ExtU32;

/// Clock of core, SysTick and timers, Hz.
const CLOCK_HZ: u32 = 16_000_000;

/// 1 Mbit/s.
const UART_DIVIDER: u32 = CLOCK_HZ / 1_000_000;

/// Flags of the UART: noise; overrun, noise and framing.
const NOISE_ERROR: u32 = 1 << 2;
const LINE_ERRORS: u32 = 0b1110;

/// The board.
pub struct NucleoG474re;

impl Board for NucleoG474re {
    type Pwm = Pwm<pac::TIM3, C1, ComplementaryImpossible, ActiveHigh, ActiveHigh>;
    type Bridge = PA7<Output<PushPull>>;

    const NAME: &str = "nucleog474re";
    const TIMER_CLOCK_HZ: u32 = CLOCK_HZ;
    const COST_CLOCK_HZ: u32 = CLOCK_HZ;
    const INSTRUCTION_RATE_HZ: u32 = 0;
    /// LPTIM1 with the low-speed oscillator, LSI.
    const INDEPENDENT_CLOCK: IndependentClock = IndependentClock {
        nominal_hz: 32_000,
        least_hz: 29_500,
        most_hz: 34_000,
        bits: 16,
    };
    const UART_INTERRUPTS: &[u16] = &[pac::Interrupt::USART1 as u16];

    fn reset_cause() -> ResetCause {
        // SAFETY: a read and a write of the flags' register; nothing else uses them.
        let rcc = unsafe { &*pac::RCC::ptr() };
        let flags = rcc.csr().read();
        let cause = if flags.borrstf().bit() {
            ResetCause::Power
        } else if flags.iwdgrstf().bit() || flags.wwdgrstf().bit() {
            ResetCause::Watchdog
        } else if flags.sftrstf().bit() {
            ResetCause::Program
        } else if flags.pinrstf().bit() {
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
        // SAFETY: the register takes any value.
        chip.TIM2.arr().write(|w| unsafe { w.arr().bits(u32::MAX) });
        chip.TIM2.cr1().write(|w| w.cen().set_bit());

        let pin: PA6<AF2> = pins.pa6.into_alternate();
        let builder = chip.TIM3.pwm_advanced(pin, &mut rcc);
        let (_, mut pwm) = builder.period(period - 1).finalize();
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
        timer.ccr1().write(|w| {
            // SAFETY: the register takes any duty.
            unsafe { w.ccr().bits(neutral.into()) }
        });
        // Takes the duty over now, and not only when the period is over.
        timer.egr().write(|w| w.ug().set_bit());
    }

    fn pwm_output() -> (u16, u16) {
        // SAFETY: reads of two registers, without side effect.
        let timer = unsafe { &*pac::TIM3::ptr() };
        let period = timer.arr().read().arr().bits() + 1;
        (timer.ccr1().read().ccr().bits() as u16, (period / 2) as u16)
    }

    fn cost_counter() -> u32 {
        // SAFETY: a read of the counter, without side effect.
        unsafe { (*pac::TIM2::ptr()).cnt().read().bits() }
    }

    fn start_independent_counter() {
        // SAFETY: the low-power timer is used by nothing else, and the clocks by nothing that runs
        // at the same time.
        let (rcc, timer) = unsafe { (&*pac::RCC::ptr(), &*pac::LPTIMER1::ptr()) };
        rcc.csr().modify(|_, w| w.lsion().set_bit());
        rcc.apb1enr1().modify(|_, w| w.lptim1en().set_bit());
        rcc.ccipr().modify(|_, w| w.lptim1sel().lsi());
        // SAFETY: values that the registers take: no prescaler, on, the greatest period, started.
        unsafe {
            timer.cfgr().write(|w| w.bits(0));
            timer.cr().write(|w| w.bits(0b001));
            timer.arr().write(|w| w.bits(0xFFFF));
            timer.cr().write(|w| w.bits(0b101));
        }
    }

    fn independent_counter() -> u32 {
        // SAFETY: reads of the counter, without side effect.
        let timer = unsafe { &*pac::LPTIMER1::ptr() };
        // Its clock is another: a count is right if two reads are equal.
        let read = || timer.cnt().read().bits() & 0xFFFF;
        let (first, second) = (read(), read());
        if first == second { first } else { read() }
    }

    fn start_watchdog(timeout_ms: u32) {
        // SAFETY: nothing else uses the two peripherals.
        let (iwdg, debug) = unsafe { (pac::IWDG::steal(), pac::DBGMCU::steal()) };
        // A debugger that serves semihosting halts the core each time.
        debug.apb1l_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        IndependentWatchdog::new(iwdg).start(timeout_ms.millis());
    }

    fn feed_watchdog() {
        // SAFETY: nothing else uses the watchdog.
        IndependentWatchdog::new(unsafe { pac::IWDG::steal() }).feed();
    }

    fn open_uart() {
        // SAFETY: port C and USART1 are used by nothing else, and their clocks by nothing that runs
        // at the same time.
        let (rcc, port, uart) =
            unsafe { (&*pac::RCC::ptr(), &*pac::GPIOC::ptr(), &*pac::USART1::ptr()) };
        rcc.ahb2enr().modify(|_, w| w.gpiocen().set_bit());
        rcc.apb2enr().modify(|_, w| w.usart1en().set_bit());
        port.afrl().modify(|_, w| w.afrl4().af7().afrl5().af7());
        port.moder()
            .modify(|_, w| w.moder4().alternate().moder5().alternate());
        // SAFETY: a divider that the UART takes.
        uart.brr().write(|w| unsafe { w.bits(UART_DIVIDER) });
        // With its eight bytes of buffer.
        uart.cr1().write(|w| {
            let w = w.ue().set_bit().te().set_bit().re().set_bit();
            w.fifoen().set_bit().rxneie().set_bit()
        });
    }

    fn uart_receive() -> Option<u8> {
        // SAFETY: nothing else uses the UART; reading the data takes the byte out.
        let uart = unsafe { &*pac::USART1::ptr() };
        let state = uart.isr().read();
        let has_noise = state.bits() & NOISE_ERROR != 0;
        let has_error = state.ore().bit() || state.fe().bit() || has_noise;
        if has_error {
            // SAFETY: flags of the line's errors, each of which the register takes.
            uart.icr().write(|w| unsafe { w.bits(LINE_ERRORS) });
        }
        let byte = state.rxne().bit().then(|| uart.rdr().read().bits() as u8);
        byte.filter(|_| !has_error)
    }

    fn uart_send(byte: u8) -> bool {
        // SAFETY: nothing else uses the UART.
        let uart = unsafe { &*pac::USART1::ptr() };
        let has_room = uart.isr().read().txe().bit_is_set();
        if has_room {
            uart.tdr().write(|w| {
                // SAFETY: the register takes any byte.
                unsafe { w.bits(byte.into()) }
            });
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
