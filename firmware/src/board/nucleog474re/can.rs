//! FDCAN1 as CAN FD: 500 kbit/s, 2 Mbit/s in the data phase; PB8 receives, PB9 sends.
//!
//! By its registers: the crate `fdcan` has panics in `transmit` and `receive` (an index of two bits
//! whose fourth value is `unreachable!`), and waits for an abort where the queue is full.
//!
//! PB8 is also BOOT0: an idle bus holds it high, and the chip then starts its own loader. The option
//! bit nSWBOOT0 must be 0 and nBOOT0 1 on this board.
//!
//! The internal oscillator is too inaccurate for a bus with other nodes; see docs/porting.md.

use super::{CLOCK_HZ, NucleoG474re, pac};
use crate::board::CanBoard;
use core::ptr::{read_volatile, write_volatile};
use core::sync::atomic::{AtomicBool, Ordering};
use shared_model::bus::{Busy, Message};
use shared_model::can::{BitTiming, FdBus, FdController};
use shared_model::exchange::FrameBytes;

const NOMINAL: BitTiming = BitTiming::of(CLOCK_HZ, 500_000, 82);
/// The sample point is 375 ns after the start of a bit, and a transceiver's loop delay is at most
/// 255 ns: the delay needs no compensation.
const DATA: BitTiming = BitTiming::of(CLOCK_HZ, 2_000_000, 75);

/// The message RAM of FDCAN1, in words (reference manual RM0440, 44.3.3).
const MESSAGE_RAM: *mut u32 = 0x4000_A400 as *mut u32;
const RECEIVE_FIFO_0: usize = 28 + 16;
const SEND_FIFO: usize = RECEIVE_FIFO_0 + 2 * 54 + 6;
const ELEMENT_WORDS: usize = 18;
/// Elements in either queue.
const ELEMENTS: u8 = 3;

/// Bits of an element's first two words.
const IDENTIFIER_AT: u32 = 18;
const EXTENDED_OR_REMOTE: u32 = 0b11 << 29;
const FD_FRAME: u32 = 1 << 21;
const BIT_RATE_SWITCH: u32 = 1 << 20;
const LENGTH_MASK: u32 = 0xF << 16;
/// The code of 24 bytes.
const LENGTH_24: u32 = 12 << 16;

/// Bits of the control register.
const INIT: u32 = 1;
const CHANGE_ENABLE: u32 = 1 << 1;
const FD_ON: u32 = 1 << 8 | 1 << 9;
/// Frames that match no filter, and remote frames, are rejected; one filter.
const FILTERS: u32 = 1 << 16 | 0b11 << 4 | 0b11 << 2 | 0b11;
/// A filter for two identifiers, whose frames go to FIFO 0.
const FILTER_TWO_TO_FIFO_0: u32 = 0b01 << 30 | 0b001 << 27;
const ALL_SEND_ELEMENTS: u32 = 0b111;

static IS_OPEN: AtomicBool = AtomicBool::new(false);

/// The controller.
pub struct Fdcan {
    _only_one: (),
}

fn registers() -> &'static pac::fdcan1::RegisterBlock {
    // SAFETY: only this module uses the controller, and the control task alone calls it.
    unsafe { &*pac::FDCAN1::ptr() }
}

impl CanBoard for NucleoG474re {
    type Bus = FdBus<Fdcan>;

    /// The control task reads the hardware's queue. It holds three frames, and only sensor frames
    /// pass the filter: one comes per control tick, two where their jitter puts two into one tick.
    /// A fourth is lost, and found by its counter.
    const CAN_INTERRUPTS: &[u16] = &[];

    fn open_can() -> Option<Self::Bus> {
        if IS_OPEN.swap(true, Ordering::Relaxed) {
            return None;
        }
        // SAFETY: port B is used by nothing else, and the clocks by nothing that runs at the same
        // time.
        let (rcc, port) = unsafe { (&*pac::RCC::ptr(), &*pac::GPIOB::ptr()) };
        rcc.ahb2enr().modify(|_, w| w.gpioben().set_bit());
        rcc.apb1enr1().modify(|_, w| w.fdcanen().set_bit());
        // The reset default is the crystal, which does not run here.
        rcc.ccipr().modify(|_, w| w.fdcansel().pclk());
        rcc.apb1rstr1().modify(|_, w| w.fdcanrst().set_bit());
        rcc.apb1rstr1().modify(|_, w| w.fdcanrst().clear_bit());
        port.afrh().modify(|_, w| w.afrh8().af9().afrh9().af9());
        port.moder()
            .modify(|_, w| w.moder8().alternate().moder9().alternate());

        let can = registers();
        let sensor = u32::from(Message::Sensor.can_identifier());
        // SAFETY: values that the registers take, in the order of the reference manual: after its
        // reset the controller is in initialisation, which needs no wait.
        unsafe {
            can.cccr().write(|w| w.bits(INIT | CHANGE_ENABLE));
            can.nbtp().write(|w| w.bits(nominal_bits(NOMINAL)));
            can.dbtp().write(|w| w.bits(data_bits(DATA)));
            can.rxgfc().write(|w| w.bits(FILTERS));
            // Sends in the order of the requests.
            can.txbc().write(|w| w.bits(0));
            write_volatile(MESSAGE_RAM, FILTER_TWO_TO_FIFO_0 | sensor << 16 | sensor);
            can.cccr().write(|w| w.bits(INIT | CHANGE_ENABLE | FD_ON));
            // The controller joins the bus by itself.
            can.cccr().write(|w| w.bits(FD_ON));
        }
        Some(FdBus::new(Fdcan { _only_one: () }))
    }

    fn can_interrupt() {}
}

/// Each field holds its number less one; the jump width is the second segment's.
const fn nominal_bits(timing: BitTiming) -> u32 {
    let BitTiming {
        prescaler,
        segment_1,
        segment_2,
    } = timing;
    assert!(prescaler <= 512 && segment_1 <= 256 && segment_2 <= 128);
    (segment_2 - 1) << 25 | (prescaler - 1) << 16 | (segment_1 - 1) << 8 | (segment_2 - 1)
}

const fn data_bits(timing: BitTiming) -> u32 {
    let BitTiming {
        prescaler,
        segment_1,
        segment_2,
    } = timing;
    assert!(prescaler <= 32 && segment_1 <= 32 && segment_2 <= 16);
    (prescaler - 1) << 16 | (segment_1 - 1) << 8 | (segment_2 - 1) << 4 | (segment_2 - 1)
}

/// The words of an element of a queue.
fn element(queue: usize, index: u8) -> *mut [u32; ELEMENT_WORDS] {
    let word = queue + usize::from(index) * ELEMENT_WORDS;
    MESSAGE_RAM.wrapping_add(word).cast()
}

/// After bus-off the controller stays in initialisation. Drops what is old by now, and lets it wait
/// for the idle bus by itself.
fn recover() {
    let can = registers();
    if can.cccr().read().bits() & INIT == 0 {
        return;
    }
    // SAFETY: requests to cancel, and the control bits of normal operation.
    unsafe {
        can.txbcr().write(|w| w.bits(ALL_SEND_ELEMENTS));
        can.cccr().write(|w| w.bits(FD_ON));
    }
}

impl FdController for Fdcan {
    fn receive(&mut self) -> Option<(u16, FrameBytes)> {
        recover();
        let can = registers();
        for _ in 0..ELEMENTS {
            let state = can.rxf0s().read().bits();
            let (level, index) = (state & 0xF, (state >> 8 & 0b11) as u8);
            if level == 0 || index >= ELEMENTS {
                return None;
            }
            let place = element(RECEIVE_FIFO_0, index).cast::<u32>();
            let mut words = [0; 8];
            for (at, word) in words.iter_mut().enumerate() {
                // SAFETY: a word of an element of the queue, which is the program's until it is
                // acknowledged. The RAM takes accesses of words only.
                *word = unsafe { read_volatile(place.wrapping_add(at)) };
            }
            // SAFETY: an index that the register takes.
            can.rxf0a().write(|w| unsafe { w.bits(index.into()) });
            let [head, form, content @ ..] = words;
            let is_message = head & EXTENDED_OR_REMOTE == 0
                && form & (FD_FRAME | LENGTH_MASK) == FD_FRAME | LENGTH_24;
            if is_message {
                let identifier = (head >> IDENTIFIER_AT & 0x7FF) as u16;
                return Some((identifier, to_bytes(&content)));
            }
        }
        None
    }

    fn send(&mut self, identifier: u16, frame: &FrameBytes) -> Result<(), Busy> {
        recover();
        let can = registers();
        let state = can.txfqs().read();
        let index = (state.bits() >> 16 & 0b11) as u8;
        if state.bits() & 1 << 21 != 0 || index >= ELEMENTS {
            return Err(Busy);
        }
        let place = element(SEND_FIFO, index).cast::<u32>();
        let head = u32::from(identifier) << IDENTIFIER_AT;
        let form = FD_FRAME | BIT_RATE_SWITCH | LENGTH_24;
        let (content, _) = frame.as_chunks::<4>();
        let content = content.iter().map(|bytes| u32::from_le_bytes(*bytes));
        for (at, word) in [head, form].into_iter().chain(content).enumerate() {
            // SAFETY: a word of a free element of the queue.
            unsafe { write_volatile(place.wrapping_add(at), word) };
        }
        // SAFETY: a request for the element that was written.
        can.txbar().write(|w| unsafe { w.bits(1 << index) });
        Ok(())
    }
}

fn to_bytes(words: &[u32; 6]) -> FrameBytes {
    let mut frame = [0; 24];
    let (chunks, _) = frame.as_chunks_mut::<4>();
    for (chunk, word) in chunks.iter_mut().zip(words) {
        *chunk = word.to_le_bytes();
    }
    frame
}
