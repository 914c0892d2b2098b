//! The log: defmt frames to the host's console, one write per frame.
//!
//! The stock semihosting logger writes each frame in many small operations, each a trap into the
//! emulator. This one gathers a frame first. Fault handlers do not log: they may have interrupted a
//! frame.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicUsize, Ordering};
use firmware::bench::host_file::HostFile;

/// Longer frames are written in pieces.
const BUFFER_BYTES: usize = 256;
const NOT_OPEN: usize = usize::MAX;

struct Buffer {
    bytes: [u8; BUFFER_BYTES],
    length: usize,
}

impl Buffer {
    fn push(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if self.length == BUFFER_BYTES {
                self.flush();
            }
            if let Some(place) = self.bytes.get_mut(self.length) {
                *place = byte;
                self.length += 1;
            }
        }
    }

    fn flush(&mut self) {
        let handle = CONSOLE.load(Ordering::Relaxed);
        if handle != NOT_OPEN {
            let written = self.bytes.get(..self.length).unwrap_or(&[]);
            // A log that cannot be written must not stop the ECU.
            let _ = HostFile::from_handle(handle).write(written);
        }
        self.length = 0;
    }
}

struct Frame {
    encoder: defmt::Encoder,
    buffer: Buffer,
    restore: critical_section::RestoreState,
}

struct Shared(UnsafeCell<Frame>);

// SAFETY: the cell is touched only between acquire and release, which hold a critical section on a
// single core.
unsafe impl Sync for Shared {}

static FRAME: Shared = Shared(UnsafeCell::new(Frame {
    encoder: defmt::Encoder::new(),
    buffer: Buffer {
        bytes: [0; BUFFER_BYTES],
        length: 0,
    },
    restore: critical_section::RestoreState::invalid(),
}));
static CONSOLE: AtomicUsize = AtomicUsize::new(NOT_OPEN);

/// Opens the console; until then, and where the host has none, log lines are dropped.
pub fn open() {
    if let Ok(console) = HostFile::console() {
        CONSOLE.store(console.handle(), Ordering::Relaxed);
    }
}

#[defmt::global_logger]
struct Logger;

// SAFETY: acquire takes a critical section and release gives it back, so frames do not mix.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: given back in release.
        let restore = unsafe { critical_section::acquire() };
        // SAFETY: the critical section makes this the only reference.
        let frame = unsafe { &mut *FRAME.0.get() };
        frame.restore = restore;
        frame.encoder.start_frame(|bytes| frame.buffer.push(bytes));
    }

    // SAFETY: does nothing.
    unsafe fn flush() {}

    // SAFETY: defmt calls it only after acquire, as the trait demands.
    unsafe fn release() {
        // SAFETY: the critical section of acquire is still held.
        let frame = unsafe { &mut *FRAME.0.get() };
        frame.encoder.end_frame(|bytes| frame.buffer.push(bytes));
        frame.buffer.flush();
        let restore = frame.restore;
        // SAFETY: the state is that of the matching acquire.
        unsafe { critical_section::release(restore) };
    }

    // SAFETY: defmt calls it only between acquire and release, as the trait demands.
    unsafe fn write(bytes: &[u8]) {
        // SAFETY: the critical section of acquire is still held.
        let frame = unsafe { &mut *FRAME.0.get() };
        frame.encoder.write(bytes, |bytes| frame.buffer.push(bytes));
    }
}
