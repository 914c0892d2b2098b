//! End-to-end protection: every status by its sequence, every flipped bit, foreign frames, the
//! counter's wrap-around.

use proptest::prelude::*;
use shared_model::e2e::{Receiver, Sender, Status};
use shared_model::exchange::{FRAME_LEN, FrameBytes};

const DATA_ID: u16 = 0x5A01;
const MAX_DELTA_COUNTER: u8 = 3;

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn receiver() -> Receiver {
    Receiver::new(DATA_ID, MAX_DELTA_COUNTER)
}

/// The sender's frames number `from` to `to`, counted from 0.
fn frames(numbers: std::ops::Range<usize>) -> Vec<FrameBytes> {
    let mut sender = Sender::new(DATA_ID);
    let mut next = || {
        let mut frame = [0xA5; FRAME_LEN];
        sender.protect(&mut frame);
        frame
    };
    let all: Vec<FrameBytes> = (0..numbers.end).map(|_| next()).collect();
    all[numbers].to_vec()
}

/// The statuses of a new receiver that gets the sender's frames of those numbers, or nothing, one
/// after the other.
fn statuses(received: &[Option<usize>]) -> Vec<Status> {
    let frames = frames(0..600);
    let mut receiver = receiver();
    let check = |number: &Option<usize>| receiver.check(number.map(|number| &frames[number]));
    received.iter().map(check).collect()
}

#[test]
fn every_status_by_its_sequence() {
    use Status::{NoNewData, Ok, OkSomeLost, Repeated, WrongSequence};
    let cases: [(&[usize], &[Status]); 9] = [
        (&[0, 1, 2], &[Ok, Ok, Ok]),
        // One and two lost are tolerated, three are not; what follows is good again.
        (&[0, 2, 3], &[Ok, OkSomeLost, Ok]),
        (&[0, 3, 4], &[Ok, OkSomeLost, Ok]),
        (&[0, 4, 5], &[Ok, WrongSequence, Ok]),
        (&[0, 0, 1], &[Ok, Repeated, Ok]),
        // Swapped: a counter below the last one is out of sequence, and so the tolerated step
        // counts from there.
        (&[0, 2, 1, 3], &[Ok, OkSomeLost, WrongSequence, OkSomeLost]),
        // Before the first frame the receiver expects a sender that has just started.
        (&[2, 3], &[OkSomeLost, Ok]),
        (&[3, 4], &[WrongSequence, Ok]),
        // 255 would be the counter before the first.
        (&[255, 256], &[Repeated, Ok]),
    ];
    for (numbers, expected) in cases {
        let received: Vec<_> = numbers.iter().map(|&number| Some(number)).collect();
        assert_eq!(statuses(&received), expected, "{numbers:?}");
    }
    assert_eq!(
        statuses(&[None, Some(0), None, None, Some(1)]),
        [NoNewData, Ok, NoNewData, NoNewData, Ok]
    );
}

#[test]
fn only_two_statuses_let_a_frame_be_used() {
    use Status::{Error, NoNewData, Ok, OkSomeLost, Repeated, WrongSequence};
    assert!(Ok.is_ok() && OkSomeLost.is_ok());
    for status in [NoNewData, Error, Repeated, WrongSequence] {
        assert!(!status.is_ok(), "{status:?}");
    }
}

#[test]
fn counter_wraps_around_without_a_gap() {
    let received: Vec<_> = (0..600).map(Some).collect();
    assert_eq!(statuses(&received), [Status::Ok; 600]);
    let counters: Vec<u8> = frames(0..600).iter().map(|frame| frame[2]).collect();
    let expected: Vec<u8> = (0..600).map(|number| (number % 256) as u8).collect();
    assert_eq!(counters, expected);
    // Losses across the wrap, from 253 on; and a whole turn of the counter is not seen.
    let mut receiver = receiver();
    let frames = frames(0..600);
    let mut check = |number: usize| receiver.check(Some(&frames[number]));
    check(252);
    assert_eq!(check(253), Status::Ok);
    assert_eq!(check(256), Status::OkSomeLost);
    assert_eq!(check(255), Status::WrongSequence);
    assert_eq!(check(259), Status::WrongSequence);
    assert_eq!(check(259 + 256), Status::Repeated);
}

/// A step of the counter means the same wherever the counter stands.
#[test]
fn every_step_from_every_counter() {
    let frames = frames(0..256);
    for from in 0..=255_u8 {
        for to in 0..=255_u8 {
            let mut receiver = receiver();
            receiver.check(Some(&frames[usize::from(from)]));
            let expected = match to.wrapping_sub(from) {
                0 => Status::Repeated,
                1 => Status::Ok,
                2 | 3 => Status::OkSomeLost,
                _ => Status::WrongSequence,
            };
            let status = receiver.check(Some(&frames[usize::from(to)]));
            assert_eq!(status, expected, "from {from} to {to}");
            assert_eq!(receiver.counter(), to);
        }
    }
}

/// A frame that is not whole does not affect the sequence.
#[test]
fn damage_and_silence_leave_the_counter() {
    let frames = frames(0..3);
    let mut receiver = receiver();
    assert_eq!(receiver.counter(), 255);
    receiver.check(Some(&frames[0]));
    let mut damaged = frames[2];
    damaged[20] ^= 1;
    assert_eq!(receiver.check(Some(&damaged)), Status::Error);
    assert_eq!(receiver.check(None), Status::NoNewData);
    assert_eq!(receiver.counter(), 0);
    assert_eq!(receiver.check(Some(&frames[1])), Status::Ok);
}

/// The result of the package autosar-e2e 1.0.0 for zeros; `tests/frames.rs` compares frames of all
/// kinds with it.
#[test]
fn known_answers() {
    let mut sender = Sender::new(DATA_ID);
    for answer in [[0x04, 0x27, 0], [0x07, 0x10, 1], [0x02, 0x49, 2]] {
        let mut frame = [0; FRAME_LEN];
        sender.protect(&mut frame);
        assert_eq!(frame[..3], answer);
        assert_eq!(frame[3..], [0; FRAME_LEN - 3]);
    }
}

/// The same bytes from the sender of another kind of frame: every other data ID is found.
#[test]
fn masquerade_is_found() {
    for data_id in (0..=u16::MAX).filter(|&data_id| data_id != DATA_ID) {
        let mut frame = [0xA5; FRAME_LEN];
        Sender::new(data_id).protect(&mut frame);
        assert_eq!(
            receiver().check(Some(&frame)),
            Status::Error,
            "{data_id:#06x}"
        );
    }
}

/// An empty bus, or memory that was never written, is no frame.
#[test]
fn constant_bytes_are_no_frame() {
    for byte in 0..=u8::MAX {
        assert_eq!(
            receiver().check(Some(&[byte; FRAME_LEN])),
            Status::Error,
            "{byte:#04x}"
        );
    }
}

proptest! {
    #![proptest_config(cases(256))]

    /// The checksum finds every flip of one, two or three bits, and every burst that fits into it.
    #[test]
    fn damage_is_found(mut frame: FrameBytes, first in 0..8 * FRAME_LEN, second in 0..8 * FRAME_LEN, burst in 1..=u16::MAX) {
        Sender::new(DATA_ID).protect(&mut frame);
        prop_assert_eq!(receiver().check(Some(&frame)), Status::Ok);
        let flip = |frame: &mut FrameBytes, bit: usize| frame[bit / 8] ^= 1 << (bit % 8);
        for bit in 0..8 * FRAME_LEN {
            let mut damaged = frame;
            flip(&mut damaged, bit);
            prop_assert_eq!(receiver().check(Some(&damaged)), Status::Error, "flip of bit {}", bit);
            if first != second {
                flip(&mut damaged, first);
                flip(&mut damaged, second);
                prop_assert_eq!(receiver().check(Some(&damaged)), Status::Error, "flips of {}, {}, {}", bit, first, second);
            }
        }
        // Of up to 16 bits, anywhere after the header.
        let mut damaged = frame;
        let start = 2 + first % (FRAME_LEN - 3);
        let [high, low] = burst.to_be_bytes();
        damaged[start] ^= high;
        damaged[start + 1] ^= low;
        prop_assert_eq!(receiver().check(Some(&damaged)), Status::Error, "burst {:#06x} at byte {}", burst, start);
    }
}
