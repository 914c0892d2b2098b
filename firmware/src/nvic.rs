//! Interrupts of the board's chip, by their numbers.

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

/// The number of a board's interrupt.
#[derive(Clone, Copy)]
struct Number(u16);

// SAFETY: boards give numbers that their chip has.
unsafe impl InterruptNumber for Number {
    fn number(self) -> u16 {
        self.0
    }
}

/// Lets interrupts in, with a priority. For use after their handler's state is in its place.
pub fn unmask(numbers: &[u16], priority: u8) {
    for &number in numbers {
        // SAFETY: the handler's state is in its place. Not by the crate's own way to the
        // peripherals, which then are taken, and the board could not have them.
        unsafe {
            if let Some(register) = (*NVIC::PTR).ipr.get(usize::from(number)) {
                register.write(priority);
            }
            NVIC::unmask(Number(number));
        }
    }
}

/// Pends the first of some interrupts.
pub fn pend(numbers: &[u16]) {
    if let Some(&number) = numbers.first() {
        NVIC::pend(Number(number));
    }
}

/// Whether an exception number of the default handler is one of some interrupts.
pub fn is_one_of(number: i16, numbers: &[u16]) -> bool {
    u16::try_from(number).is_ok_and(|number| numbers.contains(&number))
}
