//! Data from the firmware: telemetry, and the exchange in the loop.

use crate::target::Target;
use pil::closed_loop::run;
use pil::comparison::{Depth, compare};
use pil::ecu::Software;
use pil::equivalence::trace_of;
use pil::manoeuvre::Manoeuvre;
use pil::recording::{MAGIC, Recording};
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use qemu::telemetry;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::exchange::PACKET_LEN;
use shared_model::friction::FrictionMode;
use shared_model::telemetry::{HEADER_LEN, Header, Record, TRAILER_LEN, Trailer, record_len};
use shared_model::vehicle::State;

/// A telemetry file.
pub const TELEMETRY: Target = Target {
    name: "telemetry",
    read: read_telemetry,
    repair: |bytes| repair_telemetry(bytes),
    seeds: telemetry_seeds,
    // Records and duty codes as read, the motion of them in f64, and a copy of the codes.
    multiple: 8,
    mutations: 200_000,
};

/// A recording of the loop.
pub const RECORDING: Target = Target {
    name: "recording",
    read: read_recording,
    repair: repair_recording,
    seeds: recording_seeds,
    // The scenario's text as tables, and the exchanges twice.
    multiple: 64,
    mutations: 10_000,
};

/// Most exchanges that are replayed.
const REPLAYED: usize = 2_000;

fn read_telemetry(bytes: &[u8]) {
    if let Ok(recording) = telemetry::Recording::decode(bytes) {
        let trace = trace_of(&recording);
        // As the table of `decode` has it.
        let duties = trace.duties.chunks(trace.samples_per_step);
        assert_eq!(duties.count(), trace.states.len());
        for (k, record) in recording.records.iter().enumerate() {
            assert!(trace.time_s(k).is_finite());
            recording.instructions(record.control_cost);
        }
    }
}

/// CRC-16 of the frames' last two bytes, as they follow each other.
fn repair_telemetry(bytes: &mut [u8]) {
    const CHECKSUM: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740);
    let samples = bytes
        .get(3..5)
        .map_or(1, |b| u16::from_le_bytes([b[0], b[1]]));
    let mut at = 0;
    let mut length = HEADER_LEN;
    while let Some(frame) = bytes.get_mut(at..at + length) {
        let (body, sum) = frame.split_at_mut(length - 2);
        sum.copy_from_slice(&CHECKSUM.checksum(body).to_le_bytes());
        at += length;
        length = match bytes.get(at) {
            Some(b'T') => TRAILER_LEN,
            _ => record_len(samples),
        };
    }
}

fn telemetry_seeds() -> Vec<Vec<u8>> {
    [(1, 3), (10, 2), (1000, 1)]
        .map(|(samples, records)| stream(samples, records))
        .into()
}

fn stream(samples_per_step: u16, records: u32) -> Vec<u8> {
    let state = State {
        x: [0.1, -0.2, 0.3, 0.0].into(),
        friction: FrictionMode::Sticking,
    };
    let header = Header {
        samples_per_step,
        step_rate_hz: 1000,
        pwm_period: 2500,
        cost_clock_hz: 25_000_000,
        instruction_rate_hz: 31_250_000,
        initial: state,
    };
    let trailer = Trailer {
        exit_code: 0,
        records,
        overruns: 0,
        stack_bytes: 3020,
        final_duty: 1250,
        neutral_duty: 1250,
        min_interval: 2500,
        max_interval: 2500,
    };
    let mut bytes = vec![0; HEADER_LEN];
    header.encode(&mut bytes);
    for index in 1..=records {
        let record = Record {
            index,
            state,
            control_cost: 345,
            pwm_cost: 76,
        };
        let mut frame = vec![0; record_len(samples_per_step)];
        record.encode((0..samples_per_step).map(|k| 1200 + k % 100), &mut frame);
        bytes.extend(frame);
    }
    let mut frame = [0; TRAILER_LEN];
    trailer.encode(&mut frame);
    bytes.extend(frame);
    bytes
}

fn read_recording(bytes: &[u8]) {
    if let Ok(mut recording) = Recording::read(bytes) {
        recording.exchanges.truncate(REPLAYED);
        if let Ok(replayed) = recording.replay() {
            compare(&recording.exchanges, &replayed, Depth::Bytes);
        }
    }
}

/// The count of the exchanges, and the CRC-32 of all.
fn repair_recording(bytes: &mut Vec<u8>) {
    const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    let text_at = MAGIC.len() + 4;
    let length = bytes
        .get(MAGIC.len()..text_at)
        .and_then(|b| b.first_chunk());
    let text = length.map_or(0, |&b| u32::from_le_bytes(b) as usize);
    let exchanges_at = text_at.saturating_add(text).saturating_add(4);
    if let Some(rest) = bytes.len().checked_sub(exchanges_at.saturating_add(4)) {
        let count = rest / (2 * PACKET_LEN);
        bytes[exchanges_at - 4..exchanges_at].copy_from_slice(&(count as u32).to_le_bytes());
        bytes.truncate(exchanges_at + count * 2 * PACKET_LEN + 4);
    }
    if let Some(covered) = bytes.len().checked_sub(4) {
        let sum = CHECKSUM.checksum(&bytes[..covered]);
        bytes[covered..].copy_from_slice(&sum.to_le_bytes());
    }
}

fn recording_seeds() -> Vec<Vec<u8>> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.duration_s = 0.01;
    scenario.dither.waveform = Waveform::Sine;
    let manoeuvre = Manoeuvre::constant(1750.0, 0.1);
    let ecu = ecu_scenario(&scenario, &manoeuvre);
    let vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it can be driven");
    let software = &mut Software::new(&ecu).expect("the scenario is valid");
    let mut driven = run(software, vehicle, &mut || {}).expect("it is driven");
    driven.exchanges.truncate(60);
    let recording = Recording {
        scenario: ecu,
        exchanges: driven.exchanges,
    };
    let mut bytes = Vec::new();
    recording
        .write(&mut bytes)
        .expect("it is written to memory");
    vec![bytes]
}
