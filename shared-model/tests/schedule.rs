//! The dither's schedule as the ECU looks it up: at and between its speeds, beyond them, and with
//! numbers that are none.

use proptest::prelude::*;
use shared_model::schedule::{Schedule, amplitude_v};
use shared_model::schedule_table::{SINE, SQUARE};

const SCHEDULE: Schedule<f64, 4> = Schedule {
    first_rpm: 1500.0,
    step_rpm: 25.0,
    amplitudes_v: [0.0, 0.1, 0.12, 0.11],
};

#[test]
fn between_two_speeds_it_is_the_larger_amplitude() {
    for (rpm, amplitude_v) in [
        (1500.0, 0.1),
        (1500.1, 0.1),
        (1524.9, 0.1),
        (1525.0, 0.12),
        (1549.9, 0.12),
        (1550.0, 0.12),
        (1574.9, 0.12),
        (1575.0, 0.11),
    ] {
        assert_eq!(SCHEDULE.amplitude_v(rpm), amplitude_v, "{rpm} rpm");
    }
}

#[test]
fn off_below_the_first_speed_and_the_last_amplitude_above_the_last() {
    for rpm in [1499.999, 0.0, -0.0, -1500.0, f64::MIN, f64::MIN_POSITIVE] {
        assert_eq!(SCHEDULE.amplitude_v(rpm), 0.0, "{rpm} rpm");
    }
    for rpm in [1575.1, 3000.0, 1e20, f64::MAX] {
        assert_eq!(SCHEDULE.amplitude_v(rpm), 0.11, "{rpm} rpm");
    }
}

#[test]
fn a_speed_that_is_no_number_is_off() {
    for rpm in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(SCHEDULE.amplitude_v(rpm), 0.0, "{rpm} rpm");
        let rpm = rpm as f32;
        assert_eq!(SQUARE.amplitude_v(rpm), 0.0, "{rpm} rpm");
    }
}

#[test]
fn few_entries_and_steps_that_are_none_do_no_harm() {
    assert_eq!(amplitude_v(1500.0, 25.0, &[], 1600.0), 0.0);
    assert_eq!(amplitude_v(1500.0, 25.0, &[0.1], 1500.0), 0.1);
    assert_eq!(amplitude_v(1500.0, 0.0, &[0.1, 0.2], 1500.0), 0.0);
    assert_eq!(amplitude_v(1500.0, 0.0, &[0.1, 0.2], 1600.0), 0.2);
    assert_eq!(amplitude_v(f64::NAN, 25.0, &[0.1, 0.2], 1600.0), 0.0);
}

#[test]
fn the_ecus_tables_hold_amplitudes_of_their_waveform() {
    for (schedule, greatest_v) in [(SQUARE, 0.16), (SINE, 1.4)] {
        assert!(schedule.amplitudes_v.iter().any(|&v| v > 0.0));
        assert!(
            schedule
                .amplitudes_v
                .iter()
                .all(|v| (0.0..greatest_v).contains(v))
        );
        // The paper's chaos is dithered all over its range, and calm speeds are left alone.
        for rpm in 1550..1950 {
            assert!(schedule.amplitude_v(rpm as f32) > 0.0, "{rpm} rpm");
        }
        assert_eq!(schedule.amplitude_v(1200.0), 0.0);
    }
}

proptest! {
    /// Every number gives an entry of the table or 0, in both arithmetics the same one.
    #[test]
    fn the_amplitude_is_an_entry_or_none(bits: u32) {
        let rpm = f32::from_bits(bits);
        let amplitude_v = SQUARE.amplitude_v(rpm);
        prop_assert!(amplitude_v == 0.0 || SQUARE.amplitudes_v.contains(&amplitude_v));
        let in_f64 = SQUARE.map(&f64::from).amplitude_v(f64::from(rpm));
        // A quotient just below a whole number can be rounded up to it in f32.
        let next_to_an_entry = (f64::from(rpm) / 25.0).fract().abs() > 1.0 - 1e-6;
        prop_assert!(next_to_an_entry || in_f64 == f64::from(amplitude_v));
    }
}

/// The sign of a zero too, which no comparison of numbers finds.
#[test]
fn a_schedule_with_any_bit_flipped_is_another() {
    for bit in 0..64 {
        let flip = |number: &mut f64| *number = f64::from_bits(number.to_bits() ^ (1 << bit));
        let mut flipped = [SCHEDULE; 6];
        flip(&mut flipped[0].first_rpm);
        flip(&mut flipped[1].step_rpm);
        for point in 0..4 {
            flip(&mut flipped[2 + point].amplitudes_v[point]);
        }
        assert!(flipped.iter().all(|other| *other != SCHEDULE), "bit {bit}");
        let narrow = SCHEDULE.map(&|value| value as f32);
        let mut other = narrow;
        other.amplitudes_v[0] = f32::from_bits(1 << (bit % 32));
        assert!(other != narrow, "bit {bit}");
    }
    assert!(SCHEDULE == SCHEDULE.map(&|value| value));
}
