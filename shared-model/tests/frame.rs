//! Sensor and actuator frames: bytes at their promised places, round trip bit by bit, every flipped
//! bit found.

use proptest::prelude::*;
use shared_model::e2e::{Receiver, Sender, Status};
use shared_model::exchange::{FRAME_LEN, FrameBytes};
use shared_model::frame::{
    ACTUATOR_DATA_ID, MAX_DELTA_COUNTER, SENSOR_DATA_ID, UnknownMode, challenge_echo,
    decode_actuation, decode_measurement, encode_actuation, encode_measurement,
};
use shared_model::signal::{Actuation, Measurement, Mode};

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

prop_compose! {
    /// Any bits: also infinities, and NaN with any payload.
    fn measurement()(bits in any::<[u32; 5]>()) -> Measurement<f32> {
        let [wheel_speed_rpm, yaw_rate_rad_per_s, steering_angle_rad, steering_rate_rad_per_s, current_request_a] =
            bits.map(f32::from_bits);
        Measurement { wheel_speed_rpm, yaw_rate_rad_per_s, steering_angle_rad, steering_rate_rad_per_s, current_request_a }
    }
}

prop_compose! {
    fn actuation()(
        code in 0..3_u8, faults: u32, bits in any::<[u32; 3]>(), warnings: u16, sensor_counter: u8,
        bridge_on: bool, challenge: u8,
    ) -> Actuation<f32> {
        let [motor_voltage_v, dither_amplitude_v, wheel_speed_limit_rpm] = bits.map(f32::from_bits);
        let mode = Mode::from_code(code).unwrap();
        Actuation {
            mode, faults, motor_voltage_v, dither_amplitude_v, wheel_speed_limit_rpm, warnings, sensor_counter, bridge_on,
            challenge,
        }
    }
}

fn receiver(data_id: u16) -> Receiver {
    Receiver::new(data_id, MAX_DELTA_COUNTER)
}

/// The first frame of a sender is good, is found to be damaged whichever bit is flipped, and is
/// none of the other kind.
fn check_protection(
    frame: &FrameBytes,
    data_id: u16,
    other_data_id: u16,
) -> Result<(), TestCaseError> {
    prop_assert_eq!(receiver(data_id).check(Some(frame)), Status::Ok);
    prop_assert_eq!(receiver(other_data_id).check(Some(frame)), Status::Error);
    for bit in 0..8 * FRAME_LEN {
        let mut damaged = *frame;
        damaged[bit / 8] ^= 1 << (bit % 8);
        let status = receiver(data_id).check(Some(&damaged));
        prop_assert_eq!(status, Status::Error, "flip of bit {}", bit);
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(256))]

    #[test]
    fn measurements(measurement in measurement(), echo: u8) {
        let frame = encode_measurement(&measurement, echo, &mut Sender::new(SENSOR_DATA_ID));
        // As bits: NaN is not equal to itself.
        prop_assert_eq!(decode_measurement(&frame).map(&f32::to_bits), measurement.map(&f32::to_bits));
        prop_assert_eq!(challenge_echo(&frame), echo);
        check_protection(&frame, SENSOR_DATA_ID, ACTUATOR_DATA_ID)?;
    }

    #[test]
    fn actuations(actuation in actuation()) {
        let frame = encode_actuation(&actuation, &mut Sender::new(ACTUATOR_DATA_ID));
        let bits = |a: Actuation<f32>| (
            (a.mode, a.faults, a.warnings, a.sensor_counter, a.bridge_on, a.challenge),
            [a.motor_voltage_v, a.dither_amplitude_v, a.wheel_speed_limit_rpm].map(f32::to_bits),
        );
        prop_assert_eq!(decode_actuation(&frame).map(bits), Ok(bits(actuation)));
        check_protection(&frame, ACTUATOR_DATA_ID, SENSOR_DATA_ID)?;
    }
}

/// The layout is a promise to other tools: little-endian, at fixed places.
#[test]
fn bytes_are_as_promised() {
    let measurement = Measurement {
        wheel_speed_rpm: f32::from_bits(0x0403_0201),
        yaw_rate_rad_per_s: f32::from_bits(0x0807_0605),
        steering_angle_rad: f32::from_bits(0x0c0b_0a09),
        steering_rate_rad_per_s: f32::from_bits(0x100f_0e0d),
        current_request_a: f32::from_bits(0x1413_1211),
    };
    let mut sender = Sender::new(SENSOR_DATA_ID);
    let [first, second] = [(); 2].map(|()| encode_measurement(&measurement, 0xa5, &mut sender));
    assert_eq!((first[2], second[2]), (0, 1), "the counter");
    assert_eq!(first[3], 0xa5);
    assert!(first[4..].iter().copied().eq(1..=20), "{first:?}");
    assert_eq!(first[3..], second[3..]);

    let actuation = Actuation {
        mode: Mode::Safe,
        faults: 0x0403_0201,
        motor_voltage_v: f32::from_bits(0x0807_0605),
        dither_amplitude_v: f32::from_bits(0x0c0b_0a09),
        wheel_speed_limit_rpm: f32::from_bits(0x100f_0e0d),
        warnings: 0x1211,
        sensor_counter: 0x13,
        bridge_on: false,
        challenge: 0x14,
    };
    let frame = encode_actuation(&actuation, &mut Sender::new(ACTUATOR_DATA_ID));
    assert_eq!(frame[2..4], [0, 2]);
    assert!(frame[4..].iter().copied().eq(1..=20), "{frame:?}");
    let with_bridge = Actuation {
        bridge_on: true,
        ..actuation
    };
    let frame = encode_actuation(&with_bridge, &mut Sender::new(ACTUATOR_DATA_ID));
    assert_eq!(frame[3], 0x82);
}

/// A mode that does not exist is no damage that the checksum can see.
#[test]
fn unknown_modes_are_refused() {
    for code in 3..0x80 {
        for bridge_on in [0, 0x80] {
            let mut frame = [0; FRAME_LEN];
            frame[3] = code | bridge_on;
            assert_eq!(decode_actuation(&frame), Err(UnknownMode(code)));
        }
    }
    assert_eq!(UnknownMode(3).to_string(), "unknown mode 3");
}
