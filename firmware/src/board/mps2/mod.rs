//! Arm MPS2 with the AN386 (Cortex-M4F) or AN500 (Cortex-M7) image, as QEMU emulates them.
//!
//! The board has no PWM and no bridge. Virtual ones take their place: they hold duty code and
//! enable pin in registers of RAM, and the duty codes of the last periods for a debugger.

use super::{Board, BoardError, systick};
use core::convert::Infallible;
use core::ptr::{read_volatile, write_volatile};
use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{ErrorType, SetDutyCycle};
use shared_model::diagnostic::ResetCause;
use shared_model::independent_clock::IndependentClock;

/// Clock of the core, SysTick and the APB timers, Hz.
const CLOCK_HZ: u32 = 25_000_000;

/// The emulator runs with `-icount shift=5`: 32 ns per instruction, a little above the real board's
/// one instruction per clock at best, and slow enough that the 25 MHz counters resolve single
/// instructions.
const INSTRUCTION_RATE_HZ: u32 = 31_250_000;

/// CMSDK APB timer 0: control, value and reload registers. Counts down.
const TIMER0_CTRL: *mut u32 = 0x4000_0000 as *mut u32;
const TIMER0_VALUE: *mut u32 = 0x4000_0004 as *mut u32;
const TIMER0_RELOAD: *mut u32 = 0x4000_0008 as *mut u32;
/// CMSDK APB timer 1.
const TIMER1_CTRL: *mut u32 = 0x4000_1000 as *mut u32;
const TIMER1_VALUE: *mut u32 = 0x4000_1004 as *mut u32;
const TIMER1_RELOAD: *mut u32 = 0x4000_1008 as *mut u32;
/// CMSDK watchdog: load, control, interrupt-clear and lock registers.
const WATCHDOG_LOAD: *mut u32 = 0x4000_8000 as *mut u32;
const WATCHDOG_CTRL: *mut u32 = 0x4000_8008 as *mut u32;
const WATCHDOG_INTCLR: *mut u32 = 0x4000_800C as *mut u32;
const WATCHDOG_LOCK: *mut u32 = 0x4000_8C00 as *mut u32;
const WATCHDOG_UNLOCK_KEY: u32 = 0x1ACC_E551;
/// Raises the non-maskable interrupt at the first expiry, without a reset at the second.
const WATCHDOG_INTERRUPT: u32 = 1;

/// CMSDK UART 1: data, state, control, interrupt and baud-rate registers. UART 0 is the console.
const UART1_DATA: *mut u32 = 0x4000_5000 as *mut u32;
const UART1_STATE: *mut u32 = 0x4000_5004 as *mut u32;
const UART1_CTRL: *mut u32 = 0x4000_5008 as *mut u32;
const UART1_INTCLEAR: *mut u32 = 0x4000_500C as *mut u32;
const UART1_BAUDDIV: *mut u32 = 0x4000_5010 as *mut u32;
const UART_TX_FULL: u32 = 1;
const UART_RX_FULL: u32 = 2;
/// Sender, receiver, and an interrupt of each.
const UART_ON: u32 = 0b1111;
const UART_RX_INTERRUPT: u32 = 0b1000;
const UART_INTERRUPT_BITS: u32 = 0b1111;
/// 1 Mbit/s.
const UART_DIVIDER: u32 = CLOCK_HZ / 1_000_000;
/// Received byte, room to send.
const UART_INTERRUPTS: [u16; 2] = [2, 3];

/// Duty codes that the virtual PWM remembers.
const TRACE_LEN: u32 = 128;

/// The registers of virtual PWM and bridge, and the duties of the last periods for a debugger.
#[repr(C)]
struct Registers {
    /// Periods since the start.
    periods: AtomicU32,
    duty: AtomicU16,
    period: AtomicU16,
    /// The enable pin of the bridge.
    bridge: AtomicU32,
    /// Duty and bridge of period n at n modulo the length.
    trace: [AtomicU32; TRACE_LEN as usize],
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "VIRTUAL_PWM")]
static REGISTERS: Registers = Registers {
    periods: AtomicU32::new(0),
    duty: AtomicU16::new(0),
    period: AtomicU16::new(0),
    bridge: AtomicU32::new(0),
    trace: [const { AtomicU32::new(0) }; TRACE_LEN as usize],
};

/// The board.
pub struct Mps2;

/// The virtual PWM.
pub struct VirtualPwm {
    period: u16,
}

impl ErrorType for VirtualPwm {
    type Error = Infallible;
}

impl SetDutyCycle for VirtualPwm {
    fn max_duty_cycle(&self) -> u16 {
        self.period
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        let duty = duty.min(self.period);
        REGISTERS.duty.store(duty, Ordering::Relaxed);
        let period = REGISTERS.periods.load(Ordering::Relaxed);
        REGISTERS
            .periods
            .store(period.wrapping_add(1), Ordering::Relaxed);
        if let Some(place) = REGISTERS.trace.get((period % TRACE_LEN) as usize) {
            let bridge = REGISTERS.bridge.load(Ordering::Relaxed);
            place.store(u32::from(duty) | bridge << 16, Ordering::Relaxed);
        }
        Ok(())
    }
}

/// The virtual enable pin.
pub struct VirtualBridge;

impl digital::ErrorType for VirtualBridge {
    type Error = Infallible;
}

impl OutputPin for VirtualBridge {
    fn set_low(&mut self) -> Result<(), Infallible> {
        REGISTERS.bridge.store(0, Ordering::Relaxed);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        REGISTERS.bridge.store(1, Ordering::Relaxed);
        Ok(())
    }
}

impl Board for Mps2 {
    type Pwm = VirtualPwm;
    type Bridge = VirtualBridge;

    const NAME: &str = "mps2";
    const TIMER_CLOCK_HZ: u32 = CLOCK_HZ;
    const COST_CLOCK_HZ: u32 = CLOCK_HZ;
    const INSTRUCTION_RATE_HZ: u32 = INSTRUCTION_RATE_HZ;
    /// In the emulator all clocks are one.
    const INDEPENDENT_CLOCK: IndependentClock = IndependentClock {
        nominal_hz: CLOCK_HZ,
        least_hz: CLOCK_HZ,
        most_hz: CLOCK_HZ,
        bits: 32,
    };
    const UART_INTERRUPTS: &[u16] = &UART_INTERRUPTS;

    /// The emulator does not report it.
    fn reset_cause() -> ResetCause {
        ResetCause::Unknown
    }

    fn start_pwm(period: u16) -> Result<(VirtualPwm, VirtualBridge), BoardError> {
        let mut core = cortex_m::Peripherals::take().ok_or(BoardError)?;
        REGISTERS.period.store(period, Ordering::Relaxed);
        Self::neutralise_pwm();

        // SAFETY: writes to registers of the timer, which nothing else uses.
        unsafe {
            write_volatile(TIMER0_RELOAD, u32::MAX);
            write_volatile(TIMER0_VALUE, u32::MAX);
            write_volatile(TIMER0_CTRL, 1);
        }
        systick::start(&mut core.SYST, period.into());
        Ok((VirtualPwm { period }, VirtualBridge))
    }

    fn disable_bridge() {
        REGISTERS.bridge.store(0, Ordering::Relaxed);
    }

    fn neutralise_pwm() {
        let neutral = REGISTERS.period.load(Ordering::Relaxed) / 2;
        REGISTERS.duty.store(neutral, Ordering::Relaxed);
    }

    fn pwm_output() -> (u16, u16) {
        (
            REGISTERS.duty.load(Ordering::Relaxed),
            REGISTERS.period.load(Ordering::Relaxed) / 2,
        )
    }

    fn cost_counter() -> u32 {
        // SAFETY: a read of the timer's value register, without side effect.
        unsafe { u32::MAX - read_volatile(TIMER0_VALUE) }
    }

    fn start_independent_counter() {
        // SAFETY: writes to registers of the timer, which nothing else uses.
        unsafe {
            write_volatile(TIMER1_RELOAD, u32::MAX);
            write_volatile(TIMER1_VALUE, u32::MAX);
            write_volatile(TIMER1_CTRL, 1);
        }
    }

    fn independent_counter() -> u32 {
        // SAFETY: a read of the timer's value register, without side effect.
        unsafe { u32::MAX - read_volatile(TIMER1_VALUE) }
    }

    fn start_watchdog(timeout_ms: u32) {
        // SAFETY: writes to registers of the watchdog, which nothing else uses.
        unsafe {
            write_volatile(WATCHDOG_LOCK, WATCHDOG_UNLOCK_KEY);
            write_volatile(WATCHDOG_LOAD, timeout_ms * (CLOCK_HZ / 1000));
            write_volatile(WATCHDOG_CTRL, WATCHDOG_INTERRUPT);
        }
    }

    /// No WFI: a halted core hands every wake-up from one of the emulator's threads to the other,
    /// which takes longer than to run through a block of instructions that do nothing.
    // Out of line: the block is too long to be jumped over by the shortest branches.
    #[inline(never)]
    fn idle() {
        // SAFETY: touches nothing.
        unsafe { core::arch::asm!(".rept 256", "nop", ".endr", options(nomem, nostack)) };
    }

    fn feed_watchdog() {
        // SAFETY: a write to the watchdog's clear register, which reloads its counter.
        unsafe { write_volatile(WATCHDOG_INTCLR, 1) };
    }

    fn open_uart() {
        // SAFETY: accesses to registers of the UART, which nothing else uses.
        unsafe {
            write_volatile(UART1_BAUDDIV, UART_DIVIDER);
            write_volatile(UART1_CTRL, UART_ON);
            // A byte from before the start: the emulator passes no other on until it is taken.
            read_volatile(UART1_DATA);
        }
    }

    fn uart_acknowledge() {
        // SAFETY: a write to the UART's interrupt register.
        unsafe { write_volatile(UART1_INTCLEAR, UART_INTERRUPT_BITS) };
    }

    fn uart_receive() -> Option<u8> {
        // SAFETY: reads of the UART's state and data registers; the latter takes the byte out.
        unsafe {
            let is_full = read_volatile(UART1_STATE) & UART_RX_FULL != 0;
            is_full.then(|| read_volatile(UART1_DATA) as u8)
        }
    }

    fn uart_send(byte: u8) -> bool {
        // SAFETY: a read of the UART's state and a write of its data register.
        unsafe {
            let has_room = read_volatile(UART1_STATE) & UART_TX_FULL == 0;
            if has_room {
                write_volatile(UART1_DATA, byte.into());
            }
            has_room
        }
    }

    fn uart_interrupt_on_byte(on: bool) {
        let control = if on {
            UART_ON
        } else {
            UART_ON & !UART_RX_INTERRUPT
        };
        // SAFETY: a write to the UART's control register.
        unsafe { write_volatile(UART1_CTRL, control) };
    }

    /// It interrupts after each byte sent, whatever follows.
    fn uart_interrupt_on_room(_on: bool) {}
}
