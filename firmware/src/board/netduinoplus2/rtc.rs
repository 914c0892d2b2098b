//! The RTC as a counter of the low-speed oscillator: its sub-seconds are a counter of 15 bits,
//! downwards, at the rate of the oscillator.

use stm32f4xx_hal::pac;

const COUNTS: u32 = 0x7FFF;
/// Keys of the write protection.
const UNLOCK: [u32; 2] = [0xCA, 0x53];
const LOCK: u32 = 0xFF;
/// The low-speed oscillator as the clock of the RTC, the RTC on; its field.
const LOW_SPEED: u32 = 0b10 << 8;
const SOURCE_MASK: u32 = 0b11 << 8;
const RTC_ON: u32 = 1 << 15;
const BACKUP_RESET: u32 = 1 << 16;
const BYPASS_SHADOW: u32 = 1 << 5;
const INIT_REQUEST: u32 = 1 << 7;
const IN_INIT: u32 = 1 << 6;
/// Reads of the acknowledgement at most: it takes two periods of the oscillator after its start,
/// some 5000 clocks.
const INIT_READS: u32 = 20_000;

/// Starts the counter. Where the RTC does not answer, it stands still, which the check finds.
pub fn start() {
    // SAFETY: nothing else uses the RTC and the power control, and nothing that runs at the same
    // time the clocks.
    let (rcc, power, rtc) = unsafe { (&*pac::RCC::ptr(), &*pac::PWR::ptr(), &*pac::RTC::ptr()) };
    rcc.apb1enr().modify(|_, w| w.pwren().enabled());
    power.cr().modify(|_, w| w.dbp().set_bit());
    rcc.csr().modify(|_, w| w.lsion().set_bit());
    // SAFETY: values that the registers take, in the order of the reference manual RM0090, 26.3.5.
    unsafe {
        // The source can be chosen once after a reset of the backup domain.
        if rcc.bdcr().read().bits() & SOURCE_MASK != LOW_SPEED {
            rcc.bdcr().write(|w| w.bits(BACKUP_RESET));
            rcc.bdcr().write(|w| w.bits(0));
        }
        rcc.bdcr().write(|w| w.bits(LOW_SPEED | RTC_ON));
        for key in UNLOCK {
            rtc.wpr().write(|w| w.bits(key));
        }
        rtc.isr().write(|w| w.bits(INIT_REQUEST));
        let is_ready = (0..INIT_READS).any(|_| rtc.isr().read().bits() & IN_INIT != 0);
        if is_ready {
            // Two writes, the synchronous prescaler first.
            rtc.prer().write(|w| w.bits(COUNTS));
            rtc.prer().write(|w| w.bits(COUNTS));
            rtc.cr().modify(|r, w| w.bits(r.bits() | BYPASS_SHADOW));
        }
        rtc.isr().write(|w| w.bits(0));
        rtc.wpr().write(|w| w.bits(LOCK));
    }
}

/// The counter, upwards.
pub fn counter() -> u32 {
    // SAFETY: reads of the sub-seconds, without side effect.
    let rtc = unsafe { &*pac::RTC::ptr() };
    // Its clock is another: a count is right if two reads are equal.
    let read = || COUNTS - (rtc.ssr().read().bits() & COUNTS);
    let (first, second) = (read(), read());
    if first == second { first } else { read() }
}
