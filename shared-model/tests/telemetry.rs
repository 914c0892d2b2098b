//! Telemetry frames: round trip bit by bit, and every flipped bit and every cut is found.

use proptest::prelude::*;
use shared_model::friction::FrictionMode;
use shared_model::telemetry::{
    FrameError, HEADER_LEN, Header, RECORD_FIXED_LEN, Record, TRAILER_LEN, Trailer, VERSION,
    is_trailer, record_len,
};
use shared_model::vehicle::State;

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

prop_compose! {
    /// Any bits: also infinities, and NaN with any payload.
    fn state()(bits in any::<[u32; 4]>(), code in 0..4_u8) -> State<f32> {
        State { x: bits.map(f32::from_bits).into(), friction: FrictionMode::from_code(code).unwrap() }
    }
}

prop_compose! {
    fn header()(
        samples_per_step in 1..=1000_u16, step_rate_hz in 1..=1_000_000_u32, pwm_period in 2..=u16::MAX,
        cost_clock_hz in 1..=u32::MAX, instruction_rate_hz: u32,
        initial in state().prop_filter("a run starts at numbers", |state| state.x.iter().all(|x| x.is_finite())),
    ) -> Header {
        Header { samples_per_step, step_rate_hz, pwm_period, cost_clock_hz, instruction_rate_hz, initial }
    }
}

prop_compose! {
    fn record()(index: u32, state in state(), control_cost: u16, pwm_cost: u16) -> Record {
        Record { index, state, control_cost, pwm_cost }
    }
}

prop_compose! {
    fn trailer()(
        exit_code: u32, records: u32, overruns: u32, stack_bytes: u32, final_duty: u16, neutral_duty: u16,
        min_interval: u16, max_interval: u16,
    ) -> Trailer {
        Trailer { exit_code, records, overruns, stack_bytes, final_duty, neutral_duty, min_interval, max_interval }
    }
}

/// A state as bits: NaN is not equal to itself.
fn bits(state: &State<f32>) -> ([u32; 4], FrictionMode) {
    (
        std::array::from_fn(|k| state.x[k].to_bits()),
        state.friction,
    )
}

fn encode_header(header: &Header) -> Vec<u8> {
    let mut buffer = [0; HEADER_LEN];
    assert_eq!(header.encode(&mut buffer), HEADER_LEN);
    buffer.to_vec()
}

fn encode_record(record: &Record, duties: &[u16]) -> Vec<u8> {
    let mut buffer = vec![0; record_len(duties.len() as u16)];
    assert_eq!(
        record.encode(duties.iter().copied(), &mut buffer),
        buffer.len()
    );
    buffer
}

fn encode_trailer(trailer: &Trailer) -> Vec<u8> {
    let mut buffer = [0; TRAILER_LEN];
    assert_eq!(trailer.encode(&mut buffer), TRAILER_LEN);
    buffer.to_vec()
}

/// Every single-bit flip is refused; every cut is reported with the bytes that are missing; a
/// longer stream after the frame does not matter.
fn check_damage<F>(
    frame: &[u8],
    decode: impl Fn(&[u8]) -> Result<F, FrameError>,
) -> Result<(), TestCaseError> {
    for bit in 0..8 * frame.len() {
        let mut damaged = frame.to_vec();
        damaged[bit / 8] ^= 1 << (bit % 8);
        let error = decode(&damaged).err();
        let right = match error {
            Some(FrameError::UnknownTag(tag)) => bit < 8 && tag == damaged[0],
            Some(FrameError::Checksum { .. }) => bit >= 8,
            _ => false,
        };
        prop_assert!(right, "flip of bit {bit}: {error:?}");
    }
    for found in 0..frame.len() {
        let needed = frame.len();
        prop_assert_eq!(
            decode(&frame[..found]).err(),
            Some(FrameError::CutShort { needed, found })
        );
    }
    prop_assert!(decode(&[frame, &[0xa5; 40]].concat()).is_ok());
    Ok(())
}

proptest! {
    #![proptest_config(cases(64))]

    #[test]
    fn headers(header in header()) {
        let frame = encode_header(&header);
        let read = Header::decode(&frame).unwrap();
        prop_assert_eq!(bits(&read.initial), bits(&header.initial));
        // The rest by equality, with a state that is equal to itself.
        let initial = State { x: [0.0; 4].into(), friction: FrictionMode::Neutral };
        prop_assert_eq!(Header { initial, ..read }, Header { initial, ..header });
        prop_assert!(!is_trailer(&frame));
        check_damage(&frame, Header::decode)?;
    }

    #[test]
    fn records(record in record(), duties in prop::collection::vec(any::<u16>(), 0..20)) {
        let frame = encode_record(&record, &duties);
        let mut codes = Vec::new();
        let read = Record::decode(&frame, duties.len() as u16, |code| codes.push(code)).unwrap();
        prop_assert_eq!(bits(&read.state), bits(&record.state));
        prop_assert_eq!(
            (read.index, read.control_cost, read.pwm_cost),
            (record.index, record.control_cost, record.pwm_cost)
        );
        prop_assert_eq!(&codes, &duties);
        prop_assert!(!is_trailer(&frame));
        check_damage(&frame, |bytes| Record::decode(bytes, duties.len() as u16, |_| {}))?;
    }

    #[test]
    fn trailers(trailer in trailer()) {
        let frame = encode_trailer(&trailer);
        prop_assert_eq!(Trailer::decode(&frame), Ok(trailer));
        prop_assert!(is_trailer(&frame));
        check_damage(&frame, Trailer::decode)?;
    }

    /// A buffer that is too short, by any number of bytes, gives length 0 and no half frame that looks whole.
    #[test]
    fn short_buffer_gives_nothing(
        header in header(), record in record(), trailer in trailer(), duties in any::<[u16; 3]>(), share in 0.0..1.0_f64,
    ) {
        let short = |length: usize| vec![0; (share * length as f64) as usize];
        prop_assert_eq!(header.encode(&mut short(HEADER_LEN)), 0);
        prop_assert_eq!(record.encode(duties, &mut short(record_len(3))), 0);
        prop_assert_eq!(trailer.encode(&mut short(TRAILER_LEN)), 0);
    }
}

/// A frame's bytes with the given ones changed and its checksum made right again: what another
/// program would send.
fn forged(mut frame: Vec<u8>, changes: &[(usize, u8)]) -> Vec<u8> {
    for &(place, byte) in changes {
        frame[place] = byte;
    }
    let end = frame.len() - 2;
    let checksum = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740).checksum(&frame[..end]);
    frame[end..].copy_from_slice(&checksum.to_le_bytes());
    frame
}

const STATE: State<f32> = State {
    x: nalgebra::Vector4::new(0.15, -0.0, 0.46, 1.0),
    friction: FrictionMode::Positive,
};

const RECORD: Record = Record {
    index: 0x0403_0201,
    state: STATE,
    control_cost: 0x0605,
    pwm_cost: 0x0807,
};

#[test]
fn lengths_are_the_constants() {
    assert_eq!(encode_record(&RECORD, &[]).len(), RECORD_FIXED_LEN);
    assert_eq!(
        encode_record(&RECORD, &[0; 10]).len(),
        RECORD_FIXED_LEN + 20
    );
    assert_eq!(
        (HEADER_LEN, RECORD_FIXED_LEN, TRAILER_LEN),
        (38, 28, 27),
        "as version 2 has them"
    );
}

/// The format is a promise to readers in other languages: little-endian, bytes at fixed places,
/// CRC-16/IBM-3740.
#[test]
fn record_bytes_are_as_promised() {
    let frame = encode_record(&RECORD, &[0x0a09]);
    let mut expected = b"R\x01\x02\x03\x04".to_vec();
    for value in [0.15_f32, -0.0, 0.46, 1.0] {
        expected.extend(value.to_bits().to_le_bytes());
    }
    expected.extend([3, 5, 6, 7, 8, 9, 10, 0, 0]);
    assert_eq!(frame, forged(expected, &[]));
}

#[test]
fn other_versions_are_refused() {
    let header = Header {
        samples_per_step: 10,
        step_rate_hz: 1000,
        pwm_period: 2500,
        cost_clock_hz: 25_000_000,
        instruction_rate_hz: 0,
        initial: STATE,
    };
    let next = forged(encode_header(&header), &[(1, VERSION as u8 + 1)]);
    let error = Header::decode(&next).unwrap_err();
    assert_eq!(error, FrameError::Version(VERSION + 1));
    assert_eq!(error.to_string(), "format version 3; this program reads 2");
}

/// Nor is a header of no run.
#[test]
fn headers_of_no_run_are_refused() {
    let good = Header {
        samples_per_step: 10,
        step_rate_hz: 1000,
        pwm_period: 2500,
        cost_clock_hz: 25_000_000,
        instruction_rate_hz: 0,
        initial: STATE,
    };
    let refusal = |header: Header| {
        Header::decode(&encode_header(&header))
            .unwrap_err()
            .to_string()
    };
    assert!(Header::decode(&encode_header(&good)).is_ok());
    for (samples_per_step, bad) in [(0, "= 0"), (1001, "= 1001")] {
        let refusal = refusal(Header {
            samples_per_step,
            ..good
        });
        assert_eq!(
            refusal,
            format!("samples_per_step {bad}: must be from 1 to 1000")
        );
    }
    assert!(
        refusal(Header {
            step_rate_hz: 0,
            ..good
        })
        .contains("step_rate_hz = 0")
    );
    assert!(
        refusal(Header {
            step_rate_hz: u32::MAX,
            ..good
        })
        .contains("1000000")
    );
    assert!(
        refusal(Header {
            pwm_period: 1,
            ..good
        })
        .contains("pwm_period = 1")
    );
    assert!(
        refusal(Header {
            cost_clock_hz: 0,
            ..good
        })
        .contains("cost_clock_hz = 0")
    );
    for value in [f32::NAN, f32::INFINITY] {
        let initial = State {
            x: [0.0, value, 0.0, 0.0].into(),
            ..STATE
        };
        assert!(refusal(Header { initial, ..good }).contains("not finite"));
    }
}

/// A mode that does not exist is no damage that the checksum can see.
#[test]
fn unknown_friction_modes_are_refused() {
    for code in 4..=u8::MAX {
        let frame = forged(encode_record(&RECORD, &[]), &[(21, code)]);
        assert_eq!(
            Record::decode(&frame, 0, |_| {}),
            Err(FrameError::FrictionMode(code))
        );
    }
}

/// Duty codes are handed out only from a frame that is whole.
#[test]
fn damaged_record_hands_out_no_duty() {
    let mut frame = encode_record(&RECORD, &[1, 2, 3]);
    frame[30] ^= 1;
    let result = Record::decode(&frame, 3, |code| panic!("duty {code} of a damaged frame"));
    assert!(
        matches!(result, Err(FrameError::Checksum { .. })),
        "{result:?}"
    );
}
