//! Servo: volts to duty and back, saturation, and that a duty never wraps.

use proptest::prelude::*;
use shared_model::servo::{Duty, DutyOutOfRange, Pwm, Servo};
use shared_model::{Real, Scenario};

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// The PWM of a bus voltage with a carrier period of `period` counts.
fn pwm<T: Real>(bus_v: f64, period: u16) -> Pwm<T> {
    let mut servo = Scenario::<f64>::reconstruction().servo;
    servo.bus_voltage_v = bus_v;
    servo.timer_clock_hz = 1e3 * f64::from(period);
    let servo: Servo<T> = servo.map(&T::from_f64);
    assert_eq!(servo.period_counts(T::from_f64(1e3)), period.into());
    Pwm::new(&servo, T::from_f64(1e3))
}

/// What holds for one voltage in every arithmetic; `rounding` is that of the arithmetic.
fn check<T: Real>(bus_v: f64, period: u16, share: f64, rounding: f64) -> Result<(), TestCaseError> {
    let pwm = pwm::<T>(bus_v, period);
    let volts = T::from_f64(share * bus_v);
    let duty = pwm.duty(volts);
    prop_assert_eq!(duty.period(), period);
    let error = (pwm.volts(duty) - volts).abs().to_f64();
    let half_count = bus_v / f64::from(period);
    prop_assert!(
        error <= half_count + rounding * bus_v,
        "{error} V, half a count is {half_count} V"
    );
    // The resolution is what one count more or less makes.
    let code = duty.code().clamp(1, period - 1);
    let [low, high] = [code - 1, code + 1].map(|code| pwm.volts(Duty::new(code, period).unwrap()));
    let count = pwm.volts_per_count().to_f64();
    prop_assert!(((high - low).to_f64() - 2.0 * count).abs() <= rounding * bus_v);
    prop_assert!((count - 2.0 * half_count).abs() <= rounding * bus_v);
    Ok(())
}

fn monotone<T: Real>(bus_v: f64, period: u16, low: f64, high: f64) -> Result<(), TestCaseError> {
    let pwm = pwm::<T>(bus_v, period);
    let [low, high] = [low.min(high), low.max(high)].map(|v| pwm.duty(T::from_f64(v * bus_v)));
    prop_assert!(
        low.code() <= high.code(),
        "{low:?} for less volts than {high:?}"
    );
    Ok(())
}

/// The two ends, reached exactly and never passed; NaN means no voltage.
fn ends<T: Real>(bus_v: f64, period: u16, greatest: f64) -> Result<(), TestCaseError> {
    let pwm = pwm::<T>(bus_v, period);
    for beyond in [
        1.0001 * bus_v,
        2.0 * bus_v,
        1e9 * bus_v,
        0.5 * greatest,
        greatest,
        f64::INFINITY,
    ] {
        prop_assert_eq!(
            pwm.duty(T::from_f64(beyond)).code(),
            period,
            "full for {} V",
            beyond
        );
        prop_assert_eq!(
            pwm.duty(T::from_f64(-beyond)).code(),
            0,
            "none for {} V",
            -beyond
        );
    }
    prop_assert_eq!(pwm.duty(T::from_f64(f64::NAN)), pwm.neutral());
    let neutral_v = pwm.volts(pwm.neutral()).abs().to_f64();
    prop_assert!(
        neutral_v <= 1.0001 * bus_v / f64::from(period),
        "no voltage to within half a count"
    );
    Ok(())
}

/// Any bits are a voltage to the PWM: its code stays within the period.
fn never_wraps<T: Real>(bus_v: f64, period: u16, volts: T) -> Result<(), TestCaseError> {
    let duty = pwm::<T>(bus_v, period).duty(volts);
    prop_assert!(duty.code() <= period, "{duty:?} for {volts:?} V");
    let negative = volts < T::zero();
    prop_assert!(
        !negative || duty.code() <= period.div_ceil(2),
        "{duty:?} for {volts:?} V"
    );
    let positive = volts > T::zero();
    prop_assert!(
        !positive || duty.code() >= period / 2,
        "{duty:?} for {volts:?} V"
    );
    Ok(())
}

proptest! {
    #![proptest_config(cases(1000))]

    #[test]
    fn round_trip_is_within_half_a_count(bus_v in 0.1..1000.0_f64, period in 2..=u16::MAX, share in -1.0..=1.0_f64) {
        check::<f64>(bus_v, period, share, 1e-15)?;
        check::<f32>(bus_v, period, share, 3e-7)?;
    }

    #[test]
    fn duty_is_monotone(bus_v in 0.1..1000.0_f64, period in 2..=u16::MAX, low in -1.5..1.5_f64, high in -1.5..1.5_f64) {
        monotone::<f64>(bus_v, period, low, high)?;
        monotone::<f32>(bus_v, period, low, high)?;
        // Voltages so near to each other that they often share a count.
        monotone::<f32>(bus_v, period, low, low + 1e-5)?;
    }

    #[test]
    fn duty_saturates(bus_v in 0.1..1000.0_f64, period in 2..=u16::MAX) {
        ends::<f64>(bus_v, period, f64::MAX)?;
        ends::<f32>(bus_v, period, f32::MAX.into())?;
    }

    #[test]
    fn duty_never_wraps(bus_v in 0.1..1000.0_f64, period in 2..=u16::MAX, bits in any::<u64>()) {
        never_wraps(bus_v, period, f64::from_bits(bits))?;
        never_wraps(bus_v, period, f32::from_bits(bits as u32))?;
    }

    #[test]
    fn duty_refuses_codes_above_the_period(code in any::<u16>(), period in any::<u16>()) {
        match Duty::new(code, period) {
            Ok(duty) => {
                prop_assert!(code <= period);
                prop_assert_eq!((duty.code(), duty.period()), (code, period));
            }
            Err(error) => {
                prop_assert!(code > period);
                prop_assert_eq!(error, DutyOutOfRange { code, period });
                prop_assert_eq!(error.to_string(), format!("duty code {code}: must be from 0 to {period}"));
            }
        }
    }
}

/// Random codes seldom hit the edge itself.
#[test]
fn duty_takes_exactly_zero_to_period() {
    for period in [0, 1, 2, 2500, u16::MAX] {
        assert!(Duty::new(0, period).is_ok());
        assert!(Duty::new(period, period).is_ok());
        let above = period.checked_add(1);
        assert!(above.is_none_or(|code| Duty::new(code, period).is_err()));
    }
}

/// A period that no 16-bit timer has is cut, not wrapped to a short one.
#[test]
fn long_period_is_cut() {
    let mut servo = Scenario::<f32>::reconstruction().servo;
    servo.timer_clock_hz = 1e9;
    assert_eq!(servo.period_counts(10.0), 100_000_000);
    assert_eq!(Pwm::new(&servo, 10.0).neutral().period(), u16::MAX);
}
