//! The UART's bytes: rings between its interrupt and the control task. Nothing here waits.

use crate::board::{Board, Current};
use crate::nvic;
use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};
use critical_section::Mutex;
use heapless::spsc::{Consumer, Producer, Queue};
use shared_model::bus::{Busy, SerialBus, SerialLine};

/// The bus.
pub type ProductBus = SerialBus<Uart>;

/// Received bytes on their way: 1.3 ms of a full line of 1 Mbit/s.
const RECEIVE_RING: usize = 128;
/// Bytes that the interrupt takes at most from one control tick to the next: it is above the tasks, and a
/// line that babbles must not have their time. Three packets.
const BYTES_PER_TICK: u32 = 96;
/// Bytes to send: four packets.
const SEND_RING: usize = 128;
/// Bytes that one interrupt takes at most: more than a packet.
const BYTES_PER_INTERRUPT: usize = 64;
/// Above the PWM interrupt's: some UARTs hold one byte, and the PWM's duty may come later in its
/// period.
const PRIORITY: u8 = 0x00;

/// The interrupt's ends of the rings.
struct Ends {
    received: Producer<'static, u8, RECEIVE_RING>,
    to_send: Consumer<'static, u8, SEND_RING>,
}

/// Bytes that the interrupt may still take. At 0 it is off until the control task has emptied the ring.
static BYTES_LEFT: AtomicU32 = AtomicU32::new(BYTES_PER_TICK);
static ENDS: Mutex<Cell<Option<Ends>>> = Mutex::new(Cell::new(None));

/// The control task's end of the line.
pub struct Uart {
    received: Consumer<'static, u8, RECEIVE_RING>,
    to_send: Producer<'static, u8, SEND_RING>,
}

/// Opens the UART; `None` at the second call.
pub fn open() -> Option<ProductBus> {
    let receive = cortex_m::singleton!(: Queue<u8, RECEIVE_RING> = Queue::new())?;
    let send = cortex_m::singleton!(: Queue<u8, SEND_RING> = Queue::new())?;
    let (received, receiver) = receive.split();
    let (sender, to_send) = send.split();
    critical_section::with(|cs| ENDS.borrow(cs).set(Some(Ends { received, to_send })));
    Current::open_uart();
    nvic::unmask(Current::UART_INTERRUPTS, PRIORITY);
    Some(SerialBus::new(Uart {
        received: receiver,
        to_send: sender,
    }))
}

/// The UART's interrupt, if `number` is one.
pub fn interrupt(number: i16) -> bool {
    let is_uart = nvic::is_one_of(number, Current::UART_INTERRUPTS);
    if is_uart {
        // By taking them out and putting them back: nothing else has them meanwhile.
        if let Some(mut ends) = critical_section::with(|cs| ENDS.borrow(cs).take()) {
            ends.work();
            critical_section::with(|cs| ENDS.borrow(cs).set(Some(ends)));
        }
    }
    is_uart
}

impl Ends {
    fn work(&mut self) {
        Current::uart_acknowledge();
        for _ in 0..BYTES_PER_INTERRUPT {
            let left = BYTES_LEFT.load(Ordering::Relaxed);
            if left == 0 {
                // Bytes that come now are lost, and their packets with them.
                Current::uart_interrupt_on_byte(false);
                break;
            }
            let Some(byte) = Current::uart_receive() else {
                break;
            };
            BYTES_LEFT.store(left - 1, Ordering::Relaxed);
            let _ = self.received.enqueue(byte);
        }
        for _ in 0..SEND_RING {
            let Some(&byte) = self.to_send.peek() else {
                break;
            };
            if !Current::uart_send(byte) {
                break;
            }
            self.to_send.dequeue();
        }
        Current::uart_interrupt_on_room(self.to_send.ready());
    }
}

impl SerialLine for Uart {
    fn receive(&mut self) -> Option<u8> {
        let byte = self.received.dequeue();
        if byte.is_none() {
            let was_off = critical_section::with(|_| {
                let was_off = BYTES_LEFT.load(Ordering::Relaxed) == 0;
                BYTES_LEFT.store(BYTES_PER_TICK, Ordering::Relaxed);
                if was_off {
                    Current::uart_interrupt_on_byte(true);
                }
                was_off
            });
            if was_off {
                // For a byte that came meanwhile.
                nvic::pend(Current::UART_INTERRUPTS);
            }
        }
        byte
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), Busy> {
        if SEND_RING - 1 - self.to_send.len() < bytes.len() {
            return Err(Busy);
        }
        for &byte in bytes {
            // There is room, as seen above: only the interrupt changes it, and it makes more.
            let _ = self.to_send.enqueue(byte);
        }
        nvic::pend(Current::UART_INTERRUPTS);
        Ok(())
    }
}
