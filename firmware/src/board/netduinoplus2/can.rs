//! CAN1 as classic CAN: 1 Mbit/s, three frames per message; PB8 receives, PB9 sends. QEMU has none.
//!
//! By its registers: the crate `bxcan` has a panic in `transmit` (an index of two bits whose fourth
//! value is `unreachable!`), and waits for the bus where it is opened.
//!
//! At 500 kbit/s the six frames of a control tick would take 1.3 to 1.6 ms.

use super::{CLOCK_HZ, NetduinoPlus2, pac};
use crate::board::CanBoard;
use crate::board::rings::{self, RingController};
use shared_model::bus::Message;
use shared_model::can::{BitTiming, ClassicBus};
use shared_model::segments::{SEGMENTS, Segment, first_identifier};

const TIMING: BitTiming = BitTiming::of(CLOCK_HZ, 1_000_000, 82);

/// Bits of the master control register: initialisation; sends in the order of the requests;
/// recovers from bus-off by itself.
const INIT: u32 = 1;
const SEND_IN_ORDER: u32 = 1 << 2;
const RECOVER: u32 = 1 << 6;
/// Reads of the acknowledgement at most, before the controller counts as not there: some hundred
/// bit times.
const INIT_READS: u32 = 10_000;
const IN_INIT: u32 = 1;
/// Interrupts: a mailbox became empty, a frame came.
const INTERRUPTS: u32 = 0b11;
/// Of each mailbox: the request is done (cleared by writing it), abort it, it is empty.
const DONE: u32 = 1 << 16 | 1 << 8 | 1;
const ABORT: u32 = 1 << 23 | 1 << 15 | 1 << 7;
const FIRST_EMPTY: u32 = 1 << 26;
const BUS_OFF: u32 = 1 << 2;
/// Of the receive queue: frames in it, release one.
const FRAMES: u32 = 0b11;
const RELEASE: u32 = 1 << 5;
/// Of an identifier's register.
const IDENTIFIER_AT: u32 = 21;
const EXTENDED_OR_REMOTE: u32 = 0b110;
const SEND_REQUEST: u32 = 1;
const LENGTH_MASK: u32 = 0xF;
const LENGTH_8: u32 = 8;

fn registers() -> &'static pac::can1::RegisterBlock {
    // SAFETY: only this module uses the controller: `open_can`, and after it the interrupt.
    unsafe { &*pac::CAN1::ptr() }
}

impl CanBoard for NetduinoPlus2 {
    type Bus = ClassicBus<RingController>;

    const CAN_INTERRUPTS: &[u16] = &[
        pac::Interrupt::CAN1_TX as u16,
        pac::Interrupt::CAN1_RX0 as u16,
    ];

    fn open_can() -> Option<Self::Bus> {
        let controller = rings::open()?;
        // SAFETY: port B is used by nothing else, and the clocks by nothing that runs at the same
        // time.
        let (rcc, port) = unsafe { (&*pac::RCC::ptr(), &*pac::GPIOB::ptr()) };
        rcc.ahb1enr().modify(|_, w| w.gpioben().enabled());
        rcc.apb1enr().modify(|_, w| w.can1en().enabled());
        port.afrh().modify(|_, w| w.afrh8().af9().afrh9().af9());
        port.moder()
            .modify(|_, w| w.moder8().alternate().moder9().alternate());

        let can = registers();
        // SAFETY: leaves sleep, and requests initialisation.
        can.mcr().write(|w| unsafe { w.bits(INIT) });
        let is_ready = (0..INIT_READS).any(|_| can.msr().read().bits() & IN_INIT != 0);
        if !is_ready {
            return None;
        }
        // SAFETY: values that the registers take, in the order of the reference manual RM0090.
        unsafe {
            can.btr().write(|w| w.bits(timing_bits(TIMING)));
            set_filter(can);
            can.ier().write(|w| w.bits(INTERRUPTS));
            // Ends the initialisation: the controller joins the bus by itself.
            can.mcr().write(|w| w.bits(SEND_IN_ORDER | RECOVER));
        }
        Some(ClassicBus::new(controller))
    }

    fn can_interrupt() {
        let can = registers();
        // SAFETY: clears the flags of mailboxes that are done.
        can.tsr().write(|w| unsafe { w.bits(DONE) });
        if can.esr().read().bits() & BUS_OFF != 0 {
            // Old by the time the bus is back.
            // SAFETY: requests to abort.
            can.tsr().write(|w| unsafe { w.bits(ABORT) });
        }
        rings::exchange(receive, send);
    }
}

/// Each field holds its number less one; the jump width is three quanta.
const fn timing_bits(timing: BitTiming) -> u32 {
    let BitTiming {
        prescaler,
        segment_1,
        segment_2,
    } = timing;
    assert!(prescaler <= 1024 && segment_1 <= 16 && segment_2 <= 8 && segment_2 >= 3);
    2 << 24 | (segment_2 - 1) << 20 | (segment_1 - 1) << 16 | (prescaler - 1)
}

/// Bank 0 as a list of four identifiers of 16 bits: the three segments of the sensor message, the
/// first of them twice. The reset value of the other settings sends all to queue 0.
fn set_filter(can: &pac::can1::RegisterBlock) {
    let first = u32::from(first_identifier(Message::Sensor));
    let entries = |low: u32, high: u32| high << 21 | low << 5;
    // SAFETY: values that the registers take.
    unsafe {
        can.fmr().modify(|r, w| w.bits(r.bits() | 1));
        can.fm1r().write(|w| w.bits(1));
        if let Some(bank) = can.fb_iter().next() {
            bank.fr1().write(|w| w.bits(entries(first, first + 1)));
            bank.fr2().write(|w| w.bits(entries(first + 2, first)));
        }
        can.fa1r().write(|w| w.bits(1));
        can.fmr().modify(|r, w| w.bits(r.bits() & !1));
    }
}

/// The next frame of the queue. Without one that is released already the interrupt comes again.
fn receive() -> Option<Segment> {
    let can = registers();
    for _ in 0..SEGMENTS {
        let state = can.rf0r().read().bits();
        if state & FRAMES == 0 || state & RELEASE != 0 {
            return None;
        }
        let mailbox = can.rx_iter().next()?;
        let identifier = mailbox.rir().read().bits();
        let length = mailbox.rdtr().read().bits() & LENGTH_MASK;
        let low = mailbox.rdlr().read().bits();
        let high = mailbox.rdhr().read().bits();
        // SAFETY: releases the frame that was read.
        can.rf0r().write(|w| unsafe { w.bits(RELEASE) });
        if identifier & EXTENDED_OR_REMOTE == 0 && length == LENGTH_8 {
            let [a, b, c, d] = low.to_le_bytes();
            let [e, f, g, h] = high.to_le_bytes();
            return Some(Segment {
                identifier: (identifier >> IDENTIFIER_AT) as u16,
                bytes: [a, b, c, d, e, f, g, h],
            });
        }
    }
    None
}

/// Puts a frame into an empty mailbox, if there is one.
fn send(segment: &Segment) -> bool {
    let can = registers();
    let state = can.tsr().read().bits();
    let empty = |index: usize| state & FIRST_EMPTY << index != 0;
    let free = can.tx_iter().enumerate().find(|(index, _)| empty(*index));
    let Some((_, mailbox)) = free else {
        return false;
    };
    let [a, b, c, d, e, f, g, h] = segment.bytes;
    let head = u32::from(segment.identifier) << IDENTIFIER_AT;
    // SAFETY: values that the registers of an empty mailbox take.
    unsafe {
        mailbox.tdtr().write(|w| w.bits(LENGTH_8));
        mailbox
            .tdlr()
            .write(|w| w.bits(u32::from_le_bytes([a, b, c, d])));
        mailbox
            .tdhr()
            .write(|w| w.bits(u32::from_le_bytes([e, f, g, h])));
        mailbox.tir().write(|w| w.bits(head | SEND_REQUEST));
    }
    true
}
