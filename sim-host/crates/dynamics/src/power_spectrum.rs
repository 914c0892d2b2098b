//! Power spectrum by Welch's method of averaged periodograms (P. D. Welch, IEEE Trans. Audio
//! Electroacoust. 15 (1967) 70).
//!
//! The signal is cut into segments that overlap by half; each has its mean removed, is weighted
//! with a (periodic) Hann window and Fourier transformed, and the squared magnitudes are averaged.
//! The density is one-sided, in the signal's unit squared per Hz: its integral from 0 to half the
//! sample rate is the signal's variance.

use crate::words::counted;
use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
use rustfft::algorithm::{BluesteinsAlgorithm, Radix4};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftDirection};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Fewest samples in a segment: a line and its surroundings are told apart.
pub const MIN_SEGMENT: usize = 16;
/// Half the width of the Hann window's main lobe, in bins.
const LOBE: usize = 2;
/// Bins on each side of a line's main lobe that count as its surroundings.
const SURROUNDINGS: usize = 16;

/// A one-sided power spectral density.
#[derive(Debug, Clone, PartialEq)]
pub struct PowerSpectrum {
    /// Distance of two bins, Hz: the sample rate over a segment's samples. A line is about one and
    /// a half of it wide (the Hann window's equivalent noise bandwidth).
    pub bin_hz: f64,
    /// Segments that were averaged. The density's relative standard error is about the inverse of
    /// its root.
    pub segments: usize,
    /// Density of each bin, the signal's unit squared per Hz; that with index `k` is at `k` times
    /// `bin_hz`.
    pub density: Vec<f64>,
}

/// A line of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralLine {
    /// Amplitude of the sine that has the power above the surroundings, in the signal's unit; 0 if
    /// there is none.
    pub amplitude: f64,
    /// Greatest density of the line over the median density of its surroundings.
    pub prominence: f64,
}

/// Why there is no spectrum.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SpectrumError {
    /// Too few samples in a segment.
    #[error("a segment of {samples} samples: must have at least {MIN_SEGMENT}")]
    ShortSegment {
        /// Samples asked for.
        samples: usize,
    },
    /// The signal is shorter than a segment.
    #[error("the signal has {samples} samples, fewer than the {segment} of a segment")]
    ShortSignal {
        /// Samples there are.
        samples: usize,
        /// Samples in a segment.
        segment: usize,
    },
    /// A sample is infinite or not a number.
    #[error("sample {index} of the signal is {value}")]
    NotFinite {
        /// Its index.
        index: usize,
        /// Its value.
        value: f64,
    },
}

/// The spectrum of a signal sampled at `rate_hz`, in segments of `segment` samples.
///
/// # Errors
/// If a segment or the signal is too short, or a sample is not finite.
///
/// ```
/// use dynamics::power_spectrum::welch;
/// let sine: Vec<f64> = (0..10_000).map(|k| 2.0 * (f64::from(k) * 0.3).sin()).collect();
/// let spectrum = welch(&sine, 1000.0, 1000).unwrap();
/// // Amplitude 2: variance 2.
/// assert!((spectrum.power() - 2.0).abs() < 1e-3);
/// ```
pub fn welch(signal: &[f64], rate_hz: f64, segment: usize) -> Result<PowerSpectrum, SpectrumError> {
    if segment < MIN_SEGMENT {
        return Err(SpectrumError::ShortSegment { samples: segment });
    }
    if signal.len() < segment {
        return Err(SpectrumError::ShortSignal {
            samples: signal.len(),
            segment,
        });
    }
    if let Some(index) = signal.iter().position(|value| !value.is_finite()) {
        return Err(SpectrumError::NotFinite {
            index,
            value: signal[index],
        });
    }
    let window: Vec<f64> = (0..segment)
        .map(|k| 0.5 - 0.5 * (TAU * k as f64 / segment as f64).cos())
        .collect();
    let transform = fourier_transform(segment);
    let mut buffer = vec![Complex::default(); segment];
    let mut sums = vec![0.0; segment / 2 + 1];
    let mut segments = 0;
    for piece in signal.windows(segment).step_by(segment / 2) {
        let mean = piece.iter().sum::<f64>() / segment as f64;
        for ((place, value), weight) in buffer.iter_mut().zip(piece).zip(&window) {
            *place = Complex::from((value - mean) * weight);
        }
        transform.process(&mut buffer);
        for (sum, value) in sums.iter_mut().zip(&buffer) {
            *sum += value.norm_sqr();
        }
        segments += 1;
    }
    let weights: f64 = window.iter().map(|weight| weight * weight).sum();
    let gain = 1.0 / (rate_hz * weights * segments as f64);
    let last = sums.len() - 1;
    let density = sums
        .into_iter()
        .enumerate()
        .map(|(k, sum)| {
            // Those without a partner at the negative frequency.
            let alone = k == 0 || (k == last && segment.is_multiple_of(2));
            sum * gain * if alone { 1.0 } else { 2.0 }
        })
        .collect();
    Ok(PowerSpectrum {
        bin_hz: rate_hz / segment as f64,
        segments,
        density,
    })
}

/// Chosen here and not by rustfft's planner, whose transforms for every prime length take longer to
/// compile than any spectrum takes.
fn fourier_transform(length: usize) -> Arc<dyn Fft<f64>> {
    let of_power_of_two = |length| Arc::new(Radix4::new(length, FftDirection::Forward));
    if length.is_power_of_two() {
        return of_power_of_two(length);
    }
    let inner = of_power_of_two((2 * length - 1).next_power_of_two());
    Arc::new(BluesteinsAlgorithm::new(length, inner))
}

impl PowerSpectrum {
    /// Frequency of the bin with index `k`, Hz.
    pub fn frequency_hz(&self, k: usize) -> f64 {
        k as f64 * self.bin_hz
    }

    /// Power in all bins, the signal's unit squared: its variance.
    pub fn power(&self) -> f64 {
        self.density.iter().sum::<f64>() * self.bin_hz
    }

    /// Frequency of the bin with the greatest density, Hz.
    pub fn peak_hz(&self) -> f64 {
        let peak = (0..self.density.len())
            .max_by(|&a, &b| self.density[a].total_cmp(&self.density[b]))
            .unwrap_or(0);
        self.frequency_hz(peak)
    }

    /// The line at a frequency (Hz); none where the spectrum does not reach, or has no surroundings
    /// for it.
    pub fn line(&self, frequency_hz: f64) -> Option<SpectralLine> {
        let middle = (frequency_hz / self.bin_hz).round();
        if !(middle >= (LOBE + 2) as f64 && middle < (self.density.len() - LOBE - 2) as f64) {
            return None;
        }
        let middle = middle as usize;
        // A line between two bins reaches one bin further.
        let (from, to) = (middle - LOBE - 1, middle + LOBE + 1);
        let lobe = &self.density[from..=to];
        let below = &self.density[from.saturating_sub(SURROUNDINGS).max(1).min(from)..from];
        let above = &self.density[to + 1..(to + 1 + SURROUNDINGS).min(self.density.len())];
        let mut around: Vec<f64> = below.iter().chain(above).copied().collect();
        around.sort_by(f64::total_cmp);
        let floor = *around.get(around.len() / 2)?;
        let power = lobe.iter().map(|density| density - floor).sum::<f64>() * self.bin_hz;
        Some(SpectralLine {
            amplitude: (2.0 * power.max(0.0)).sqrt(),
            prominence: lobe.iter().copied().fold(0.0, f64::max) / floor,
        })
    }
}

/// Intervals of the frequency axis in a chart.
const INTERVALS: f64 = 700.0;

/// The density of a signal in `unit` over the frequency, with an instant at a frequency (Hz) if one
/// is given.
pub fn chart(
    spectrum: &PowerSpectrum,
    heading: String,
    unit: &str,
    instant: Option<(f64, String)>,
) -> Chart {
    let bins = spectrum.density.iter().enumerate();
    let bins = bins.map(|(k, density)| (spectrum.frequency_hz(k), *density));
    // Without its mean the signal has nothing at zero frequency, and a logarithmic axis no place
    // for it.
    let bins: Vec<(f64, f64)> = bins.skip(1).collect();
    let ends = (bins[0].0, bins[bins.len() - 1].0);
    let panel = Panel {
        caption: format!(
            "{}, Hann window, half overlap; bins of {:.3} Hz, the greatest in each drawn interval",
            counted(spectrum.segments, "segment"),
            spectrum.bin_hz
        ),
        x: AxisSpec::logarithmic("frequency (Hz)").from_to(ends.0, ends.1),
        y: AxisSpec::logarithmic(format!("density (({unit})\u{b2}/Hz)")),
        series: vec![Series {
            label: String::new(),
            points: envelope(&bins, ends),
            look: Look::Line(0),
        }],
        instants: instant.into_iter().collect(),
        ..Panel::default()
    };
    Chart {
        heading,
        panels: vec![panel],
    }
}

/// The bin with the greatest density in each of many intervals of equal length on a logarithmic
/// axis.
fn envelope(bins: &[(f64, f64)], (low, high): (f64, f64)) -> Vec<(f64, f64)> {
    let interval = |bin: &(f64, f64)| {
        let share = (bin.0 / low).ln() / (high / low).ln();
        (share * INTERVALS) as i64
    };
    bins.chunk_by(|a, b| interval(a) == interval(b))
        .filter_map(|chunk| chunk.iter().max_by(|a, b| a.1.total_cmp(&b.1)))
        .copied()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 1000.0;

    fn sine(amplitude: f64, frequency_hz: f64, samples: u32) -> Vec<f64> {
        let omega = TAU * frequency_hz / RATE_HZ;
        let sample = |k| 7.0 + amplitude * (omega * f64::from(k)).sin();
        (0..samples).map(sample).collect()
    }

    /// Uniform noise of variance 1 from Knuth's 64-bit congruential generator.
    fn noise(samples: usize) -> Vec<f64> {
        let mut seed = 1_u64;
        let mut sample = || {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let unit = (seed >> 11) as f64 / (1_u64 << 53) as f64;
            (unit - 0.5) * 12.0_f64.sqrt()
        };
        (0..samples).map(|_| sample()).collect()
    }

    #[test]
    fn a_sine_gives_its_line_and_its_power() {
        let spectrum = welch(&sine(3.0, 125.0, 20_000), RATE_HZ, 1000).unwrap();
        assert_eq!(spectrum.segments, 39);
        assert_eq!(spectrum.peak_hz(), 125.0);
        // Parseval: variance A^2/2. The Hann window's noise bandwidth is 1.5 bins of 1 Hz.
        assert!((spectrum.power() - 4.5).abs() < 1e-9);
        assert!((spectrum.density[125] - 4.5 / 1.5).abs() < 1e-9);
        let line = spectrum.line(125.0).unwrap();
        assert!((line.amplitude - 3.0).abs() < 1e-9, "{line:?}");
    }

    #[test]
    fn a_line_between_bins_keeps_its_amplitude() {
        let spectrum = welch(&sine(3.0, 125.5, 20_000), RATE_HZ, 1000).unwrap();
        let line = spectrum.line(125.5).unwrap();
        assert!((line.amplitude - 3.0).abs() < 0.01, "{line:?}");
        assert!(line.prominence > 1e4, "{line:?}");
    }

    #[test]
    fn white_noise_is_flat_at_its_variance() {
        for segment in [256, 255] {
            let spectrum = welch(&noise(256_000), RATE_HZ, segment).unwrap();
            assert!((spectrum.power() - 1.0).abs() < 0.01);
            // One-sided: the variance over half the sample rate. 1999 overlapping segments: 2.3 %
            // standard error.
            let flat = 2.0 / RATE_HZ;
            for density in &spectrum.density[2..spectrum.density.len() - 2] {
                assert!((density / flat - 1.0).abs() < 0.12, "{density}");
            }
            let line = spectrum.line(100.0).unwrap();
            assert!(line.prominence < 1.3, "{line:?}");
        }
    }

    #[test]
    fn signals_too_short_or_not_finite_are_refused() {
        let signal = sine(1.0, 100.0, 100);
        assert!(welch(&signal, RATE_HZ, 100).is_ok());
        let errors = [
            (welch(&signal, RATE_HZ, 101), "100 samples"),
            (welch(&signal, RATE_HZ, 15), "at least 16"),
            (welch(&[f64::NAN; 20], RATE_HZ, 16), "is NaN"),
        ];
        for (result, part) in errors {
            let error = result.unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        let spectrum = welch(&signal, RATE_HZ, 100).unwrap();
        for frequency_hz in [0.0, 500.0, 1e9, f64::NAN, -1.0] {
            assert_eq!(spectrum.line(frequency_hz), None);
        }
    }
}
