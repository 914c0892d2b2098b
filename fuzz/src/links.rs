//! What comes over links: packets on a serial line, and frames protected end to end.

use crate::target::Target;
use shared_model::e2e::{Receiver, Sender};
use shared_model::exchange::{
    FRAME_LEN, FrameBytes, Packet, TO_ECU_LEN, TO_HOST_LEN, ToEcu, ToHost,
};
use shared_model::frame::{
    ACTUATOR_DATA_ID, MAX_DELTA_COUNTER, SENSOR_DATA_ID, decode_actuation, decode_measurement,
    encode_measurement,
};
use shared_model::serial::{BODY_MAX, Deframer, Received, frame};
use shared_model::signal::Measurement;

/// Packets on a serial line.
pub const SERIAL: Target = Target {
    name: "serial",
    read: read_serial,
    repair: repair_serial,
    seeds: || vec![line(&[&[1, 0, 2], &[0; BODY_MAX], &[7; TO_HOST_LEN]])],
    multiple: 0,
    mutations: 200_000,
};

/// Frames, of sensors and of the actuator in turn.
pub const FRAMES: Target = Target {
    name: "frames",
    read: read_frames,
    repair: |bytes| repair_frames(bytes),
    seeds: frame_seeds,
    multiple: 0,
    mutations: 200_000,
};

fn read_serial(bytes: &[u8]) {
    let mut deframer = Deframer::new();
    for &byte in bytes {
        if let Received::Body(body) = deframer.push(byte) {
            assert!(body.len() <= BODY_MAX);
            if let Ok(bytes) = <&[u8; TO_HOST_LEN]>::try_from(body) {
                let received = ToHost::decode(bytes);
                assert_eq!(ToHost::decode(&received.encode()), received);
            }
            if let Ok(bytes) = <&[u8; TO_ECU_LEN]>::try_from(body) {
                let received = ToEcu::decode(bytes);
                assert_eq!(ToEcu::decode(&received.encode()), received);
            }
        }
    }
}

/// What lies between zeros, as bodies of packets.
fn repair_serial(bytes: &mut Vec<u8>) {
    let bodies: Vec<&[u8]> = bytes.split(|&byte| byte == 0).collect();
    *bytes = line(&bodies);
}

fn line(bodies: &[&[u8]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for body in bodies {
        frame(body, |byte| bytes.push(byte));
    }
    bytes
}

fn data_id(k: usize) -> u16 {
    [SENSOR_DATA_ID, ACTUATOR_DATA_ID][k % 2]
}

fn read_frames(bytes: &[u8]) {
    let mut receivers = [0, 1].map(|k| Receiver::new(data_id(k), MAX_DELTA_COUNTER));
    let frames: &[FrameBytes] = bytes.as_chunks::<FRAME_LEN>().0;
    for (k, frame) in frames.iter().enumerate() {
        if receivers[k % 2].check(Some(frame)).is_ok() {
            match data_id(k) {
                SENSOR_DATA_ID => drop(decode_measurement(frame)),
                _ => drop(decode_actuation(frame)),
            }
        }
    }
    for packet in bytes.as_chunks().0 {
        let packet = Packet::decode(packet);
        assert_eq!(Packet::decode(&packet.encode()), packet);
    }
}

/// The profile's check sum: of the frame after it, and of the data ID.
fn repair_frames(bytes: &mut [u8]) {
    const CHECKSUM: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740);
    for (k, frame) in bytes.as_chunks_mut::<FRAME_LEN>().0.iter_mut().enumerate() {
        let (sum, covered) = frame.split_at_mut(2);
        let mut digest = CHECKSUM.digest();
        digest.update(covered);
        digest.update(&data_id(k).to_le_bytes());
        sum.copy_from_slice(&digest.finalize().to_le_bytes());
    }
}

fn frame_seeds() -> Vec<Vec<u8>> {
    let measurement = Measurement {
        wheel_speed_rpm: 1750.0,
        yaw_rate_rad_per_s: 0.3,
        steering_angle_rad: -0.02,
        steering_rate_rad_per_s: 1.5,
        current_request_a: 0.0,
    };
    let mut senders = [0, 1].map(|k| Sender::new(data_id(k)));
    let mut one = |k: usize| encode_measurement(&measurement, k as u8, &mut senders[k % 2]);
    vec![(0..8).flat_map(&mut one).collect()]
}
