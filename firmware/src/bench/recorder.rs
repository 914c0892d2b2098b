//! Telemetry: rings from the interrupts to the main loop, and the stream from there to the host.

use super::counters::{count_overrun, overruns, saturate};
use super::host_file::{HostFile, HostFileError};
use super::jitter;
use crate::board::{Board, Current};
use crate::stack;
use core::cell::Cell;
use core::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use critical_section::Mutex;
use heapless::spsc::{Consumer, Producer, Queue};
use shared_model::telemetry::{HEADER_LEN, Header, Record, TRAILER_LEN, Trailer};

/// Records on their way: some ten periods of the slower model rate.
const RECORD_RING: usize = 64;
/// Duty codes on their way.
const DUTY_RING: usize = 1024;
/// Bytes gathered for one write to the host.
const CHUNK_BYTES: usize = 4096;
const NOT_OPEN: usize = usize::MAX;

static RECORDED: Mutex<Cell<Option<Producer<'static, u16, DUTY_RING>>>> =
    Mutex::new(Cell::new(None));
static FILE: AtomicUsize = AtomicUsize::new(NOT_OPEN);
static RECORDS: AtomicU32 = AtomicU32::new(0);

/// Where the PWM interrupt puts the duty codes that the PWM holds.
pub struct DutyRecording(Producer<'static, u16, DUTY_RING>);

impl DutyRecording {
    /// Records a code; counts an overrun if the ring is full.
    pub fn push(&mut self, code: u16) {
        if self.0.enqueue(code).is_err() {
            count_overrun();
        }
    }
}

/// The PWM's end of the ring, once [`Recorder::new`] has made it; `None` the second time.
pub fn take_duty_recording() -> Option<DutyRecording> {
    critical_section::with(|cs| RECORDED.borrow(cs).take()).map(DutyRecording)
}

/// The control task's end of its ring.
pub struct RecordProducer(Producer<'static, Record, RECORD_RING>);

impl RecordProducer {
    /// Passes a record on; counts an overrun if the ring is full.
    pub fn push(&mut self, record: Record) {
        if self.0.enqueue(record).is_err() {
            count_overrun();
        }
    }
}

/// The main loop's end: takes records and duty codes from the rings and writes them to the host in
/// chunks.
pub struct Recorder {
    records: Consumer<'static, Record, RECORD_RING>,
    duties: Consumer<'static, u16, DUTY_RING>,
    samples_per_step: u16,
    file: Option<HostFile>,
    chunk: &'static mut [u8; CHUNK_BYTES],
    length: usize,
}

impl Recorder {
    /// The rings, and the stream if there is a `path`, with its header written. `None` at the
    /// second call.
    ///
    /// # Errors
    /// If the host cannot write the file.
    pub fn new(
        path: Option<&str>,
        header: &Header,
    ) -> Result<Option<(Self, RecordProducer)>, HostFileError> {
        let rings = (
            cortex_m::singleton!(: Queue<Record, RECORD_RING> = Queue::new()),
            cortex_m::singleton!(: Queue<u16, DUTY_RING> = Queue::new()),
            cortex_m::singleton!(: [u8; CHUNK_BYTES] = [0; CHUNK_BYTES]),
        );
        let (Some(records), Some(duties), Some(chunk)) = rings else {
            return Ok(None);
        };
        let (record_producer, records) = records.split();
        let (duty_producer, duties) = duties.split();
        critical_section::with(|cs| RECORDED.borrow(cs).set(Some(duty_producer)));

        let file = path.map(HostFile::create).transpose()?;
        if let Some(file) = file {
            let mut bytes = [0; HEADER_LEN];
            let length = header.encode(&mut bytes);
            file.write(&bytes[..length])?;
            FILE.store(file.handle(), Ordering::Relaxed);
        }
        let recorder = Self {
            records,
            duties,
            samples_per_step: header.samples_per_step,
            file,
            chunk,
            length: 0,
        };
        Ok(Some((recorder, RecordProducer(record_producer))))
    }

    /// Takes one record with its duty codes, if there is one.
    ///
    /// # Errors
    /// If the host cannot write the file.
    pub fn take_one(&mut self) -> Result<bool, HostFileError> {
        let Some(record) = self.records.dequeue() else {
            return Ok(false);
        };
        if self.file.is_none() {
            for _ in 0..self.samples_per_step {
                self.duties.dequeue();
            }
            return Ok(true);
        }
        if CHUNK_BYTES - self.length < shared_model::telemetry::record_len(self.samples_per_step) {
            self.flush()?;
        }
        let duties = core::iter::from_fn(|| self.duties.dequeue());
        let duties = duties.take(self.samples_per_step.into());
        let place = self.chunk.get_mut(self.length..).unwrap_or(&mut []);
        self.length += record.encode(duties, place);
        RECORDS.fetch_add(1, Ordering::Relaxed);
        Ok(true)
    }

    /// Writes the gathered bytes.
    ///
    /// # Errors
    /// If the host cannot write the file.
    pub fn flush(&mut self) -> Result<(), HostFileError> {
        let gathered = self.chunk.get(..self.length).unwrap_or(&[]);
        if let Some(file) = self.file {
            file.write(gathered)?;
        }
        self.length = 0;
        Ok(())
    }
}

/// Writes the trailer with the exit code, if a stream is open. Works from any handler: it needs no recorder; bytes
/// that the recorder has gathered and not written are lost.
///
/// # Errors
/// If the host cannot write the file.
pub fn finish(exit_code: u32) -> Result<(), HostFileError> {
    let handle = FILE.load(Ordering::Relaxed);
    if handle == NOT_OPEN {
        return Ok(());
    }
    let (final_duty, neutral_duty) = Current::pwm_output();
    let (min_interval, max_interval) = jitter::interval_range();
    let trailer = Trailer {
        exit_code,
        records: RECORDS.load(Ordering::Relaxed),
        overruns: overruns(),
        stack_bytes: stack::deepest_bytes(),
        final_duty,
        neutral_duty,
        min_interval: saturate(min_interval),
        max_interval: saturate(max_interval),
    };
    let mut bytes = [0; TRAILER_LEN];
    trailer.encode(&mut bytes);
    HostFile::from_handle(handle).write(&bytes)
}
