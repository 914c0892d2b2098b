//! The configuration in flash: what is written is read back, and nothing damaged passes.

use shared_model::configuration::{
    BLOCK_LEN, CONFIGURATION_LEN, ConfigurationError, ERASED, Part, block, decode, load,
};
use shared_model::dither::Waveform;
use shared_model::friction::FrictionLaw;
use shared_model::tire::TireModel;
use shared_model::vehicle::SlipForm;
use shared_model::{Preset, Scenario};

const BOARD: &str = "mps2";
const CLOCK_HZ: u32 = 25_000_000;

fn flash(scenario: &Scenario<f32>) -> Vec<u8> {
    let blocks = [Part::Application, Part::Gate].map(|part| block(part, scenario, BOARD));
    blocks.concat()
}

#[test]
fn every_choice_and_number_comes_back() {
    for preset in Preset::ALL {
        for slip_form in SlipForm::ALL {
            for model in TireModel::ALL {
                for law in FrictionLaw::ALL {
                    for waveform in Waveform::ALL {
                        let mut scenario = Scenario::<f32>::preset(preset);
                        scenario.vehicle.slip_form = slip_form;
                        scenario.tires.model = model;
                        scenario.friction.law = law;
                        scenario.dither.waveform = waveform;
                        assert_eq!(decode(&flash(&scenario), BOARD), Ok(scenario));
                    }
                }
            }
        }
    }
    let mut numbered = Scenario::<f32>::reconstruction();
    let next = std::cell::Cell::new(0.0_f32);
    numbered = numbered.map(&|_| next.replace(next.get() + 1.0));
    assert_eq!(decode(&flash(&numbered), BOARD), Ok(numbered));
    assert!(next.get() > 60.0, "each number is another");
}

/// Every bit of both blocks, values and checksums included. Bytes after a block are not read.
#[test]
fn no_flipped_bit_passes() {
    let scenario = Scenario::reconstruction();
    let good = flash(&scenario);
    assert_eq!(load(&good, BOARD, CLOCK_HZ), Ok(scenario));
    let mut refused = 0;
    for start in [0, BLOCK_LEN] {
        let length = 16 + usize::from(u16::from_le_bytes([good[start + 8], good[start + 9]]));
        for bit in 0..8 * BLOCK_LEN {
            let mut bytes = good.clone();
            bytes[start + bit / 8] ^= 1 << (bit % 8);
            let result = load(&bytes, BOARD, CLOCK_HZ);
            assert_eq!(result.is_err(), bit < 8 * length, "bit {bit}");
            refused += usize::from(result.is_err());
        }
    }
    assert!(refused > 2000, "{refused}");
}

#[test]
fn every_truncation_is_refused() {
    let good = flash(&Scenario::reconstruction());
    for length in 0..CONFIGURATION_LEN {
        assert!(
            load(&good[..length], BOARD, CLOCK_HZ).is_err(),
            "{length} bytes"
        );
        let mut erased = good.clone();
        erased[length..].fill(ERASED);
        let is_whole = erased == good;
        assert_eq!(
            load(&erased, BOARD, CLOCK_HZ).is_ok(),
            is_whole,
            "{length} bytes"
        );
    }
}

#[test]
fn a_refusal_says_which_part_and_why() {
    let scenario = Scenario::reconstruction();
    let good = flash(&scenario);
    let refused = |bytes: &[u8], board| load(bytes, board, CLOCK_HZ).expect_err("it is refused");
    assert_eq!(
        refused(&[ERASED; CONFIGURATION_LEN], BOARD),
        ConfigurationError::Erased(Part::Application)
    );
    let mut no_limits = good.clone();
    no_limits[BLOCK_LEN..].fill(ERASED);
    let error = refused(&no_limits, BOARD);
    assert_eq!(error, ConfigurationError::Erased(Part::Gate));
    assert_eq!((error.code(), error.reason()), (17, "erased"));
    assert_eq!(
        refused(&good, "another"),
        ConfigurationError::Board(Part::Application)
    );
    assert_eq!(
        load(&good, BOARD, 16_000_000),
        Err(ConfigurationError::TimerClock(25e6))
    );
    let mut heavy = scenario;
    heavy.vehicle.mass_kg = f32::NAN;
    assert!(matches!(
        refused(&flash(&heavy), BOARD),
        ConfigurationError::Invalid(_)
    ));
}

/// A limit beyond its compiled-in range does not pass, with a whole block around it.
#[test]
fn sr17_no_block_widens_a_limit_beyond_its_hard_bound() {
    let mut wide = Scenario::reconstruction();
    wide.gate.motor_voltage_v = 1e6;
    assert!(matches!(
        load(&flash(&wide), BOARD, CLOCK_HZ),
        Err(ConfigurationError::Invalid(_))
    ));
}
