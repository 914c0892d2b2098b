//! Rings between the interrupt of a classic CAN and the control task: a message is three frames, as
//! many as the controller holds, so that two messages in a row need more room.

use super::{CanBoard, Current};
use crate::nvic;
use core::cell::Cell;
use critical_section::Mutex;
use heapless::spsc::{Consumer, Producer, Queue};
use shared_model::bus::Busy;
use shared_model::can::ClassicController;
use shared_model::segments::{SEGMENTS, Segment};

/// Five messages: more than come in 2 ms at 1 Mbit/s.
const RECEIVE_RING: usize = 16;
/// Two messages: a tick's actuator frame and a diagnostic frame. One more place, as a ring is never
/// full to the last one.
const SEND_RING: usize = 2 * SEGMENTS + 1;

/// The interrupt's ends of the rings.
pub struct Ends {
    received: Producer<'static, Segment, RECEIVE_RING>,
    to_send: Consumer<'static, Segment, SEND_RING>,
}

/// The control task's ends.
pub struct RingController {
    received: Consumer<'static, Segment, RECEIVE_RING>,
    to_send: Producer<'static, Segment, SEND_RING>,
}

static ENDS: Mutex<Cell<Option<Ends>>> = Mutex::new(Cell::new(None));

/// The rings; `None` at the second call.
pub fn open() -> Option<RingController> {
    let receive = cortex_m::singleton!(: Queue<Segment, RECEIVE_RING> = Queue::new())?;
    let send = cortex_m::singleton!(: Queue<Segment, SEND_RING> = Queue::new())?;
    let (received, receiver) = receive.split();
    let (sender, to_send) = send.split();
    critical_section::with(|cs| ENDS.borrow(cs).set(Some(Ends { received, to_send })));
    Some(RingController {
        received: receiver,
        to_send: sender,
    })
}

/// The interrupt's work: received frames into their ring, and frames to send as long as `send`
/// finds room.
pub fn exchange(
    mut receive: impl FnMut() -> Option<Segment>,
    mut send: impl FnMut(&Segment) -> bool,
) {
    // By taking them out and putting them back: nothing else has them meanwhile.
    let Some(mut ends) = critical_section::with(|cs| ENDS.borrow(cs).take()) else {
        return;
    };
    for _ in 0..RECEIVE_RING {
        let Some(segment) = receive() else {
            break;
        };
        // A frame without room is lost, and its message with it.
        let _ = ends.received.enqueue(segment);
    }
    for _ in 0..SEND_RING {
        let is_sent = ends.to_send.peek().is_some_and(&mut send);
        if !is_sent {
            break;
        }
        ends.to_send.dequeue();
    }
    critical_section::with(|cs| ENDS.borrow(cs).set(Some(ends)));
}

impl ClassicController for RingController {
    fn receive(&mut self) -> Option<Segment> {
        self.received.dequeue()
    }

    fn send(&mut self, segments: &[Segment; SEGMENTS]) -> Result<(), Busy> {
        if SEND_RING - 1 - self.to_send.len() < SEGMENTS {
            return Err(Busy);
        }
        for &segment in segments {
            // There is room, as seen above: only the interrupt changes it, and it makes more.
            let _ = self.to_send.enqueue(segment);
        }
        nvic::pend(Current::CAN_INTERRUPTS);
        Ok(())
    }
}
