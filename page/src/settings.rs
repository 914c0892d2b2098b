//! A scenario from the text of a link.

use shared_model::Scenario;

/// The scenario of the settings `preset=NAME` and `section.name=value`, joined by `&`, as the ECU
/// takes them; those of the preset `reconstruction` hold for the rest.
///
/// # Errors
/// The first setting that is not one, or the first number that is not allowed.
pub fn scenario(text: &str) -> Result<Scenario<f32>, String> {
    let mut scenario = Scenario::reconstruction();
    for setting in text.split('&').filter(|setting| !setting.is_empty()) {
        let applied = scenario.apply(setting);
        applied.map_err(|error| format!("{setting}: {error}"))?;
    }
    scenario.validate().map_err(|error| error.to_string())?;
    Ok(scenario)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_applied_in_their_order() {
        let text =
            "run.wheel_speed_rpm=1600&preset=printed&dither.waveform=sine&dither.amplitude_v=1";
        let scenario = scenario(text).unwrap();
        assert_eq!(scenario.run.wheel_speed_rpm, 1750.0);
        assert!(scenario.friction.dithered);
        assert_eq!(scenario.dither.amplitude_v, 1.0);
        assert_eq!(super::scenario(""), Ok(Scenario::reconstruction()));
    }

    #[test]
    fn a_wrong_setting_is_named() {
        for (text, message) in [
            ("speed", "speed: must be key=value"),
            ("run.speed=1", "run.speed=1: no parameter of that name"),
            (
                "run.wheel_speed_rpm=fast",
                "run.wheel_speed_rpm=fast: the value is not a number",
            ),
            (
                "dither.waveform=saw",
                "dither.waveform=saw: the value is none of the parameter's names",
            ),
            (
                "run.wheel_speed_rpm=0",
                "run.wheel_speed_rpm = 0: must be a finite number from 1 to 100000",
            ),
        ] {
            assert_eq!(scenario(text).unwrap_err(), message);
        }
    }
}
