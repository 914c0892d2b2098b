//! Results as rows of a table, of numbers alone.

use super::over_speed::Point;
use super::region::Cell;
use serde::Serialize;

/// A [`Cell`] as a row of a table.
#[derive(Debug, Clone, Serialize)]
pub struct CellRow {
    wheel_speed_rpm: f64,
    gain: f64,
    delay_error_s: f64,
    multiplier: f64,
    maxima: Option<usize>,
    torque_rms_nm: f64,
    torque_peak_nm: f64,
    capture_s: Option<f64>,
}

impl From<&Cell> for CellRow {
    fn from(cell: &Cell) -> Self {
        Self {
            wheel_speed_rpm: cell.wheel_speed_rpm,
            gain: cell.gain,
            delay_error_s: cell.delay_error_s,
            multiplier: cell.multiplier,
            maxima: cell.held.maxima,
            torque_rms_nm: cell.held.torque_rms_nm,
            torque_peak_nm: cell.held.torque_peak_nm,
            capture_s: cell.held.capture_s,
        }
    }
}

/// A [`Point`] as a row of a table.
#[derive(Debug, Clone, Serialize)]
pub struct PointRow {
    wheel_speed_rpm: f64,
    period_s: f64,
    free_multiplier: f64,
    gain: f64,
    multiplier: f64,
    least_holding_gain: Option<f64>,
    greatest_holding_gain: Option<f64>,
    maxima: Option<usize>,
    torque_rms_nm: f64,
    torque_peak_nm: f64,
    capture_s: Option<f64>,
    impulse_torque_rms_nm: f64,
    impulse_torque_peak_nm: f64,
    impulse_capture_s: Option<f64>,
    rest_torque_rms_nm: f64,
    rest_torque_peak_nm: f64,
    rest_capture_s: Option<f64>,
    diverges_at_s: Option<f64>,
    yaw_rate_min_rad_per_s: Option<f64>,
    yaw_rate_max_rad_per_s: Option<f64>,
}

impl From<&Point> for PointRow {
    fn from(point: &Point) -> Self {
        let (best, held) = (&point.best, &point.held);
        Self {
            wheel_speed_rpm: point.wheel_speed_rpm,
            period_s: point.period_s,
            free_multiplier: point.free_multiplier,
            gain: best.gain,
            multiplier: best.multiplier,
            least_holding_gain: best.holding.map(|range| range.0),
            greatest_holding_gain: best.holding.map(|range| range.1),
            maxima: held.maxima,
            torque_rms_nm: held.torque_rms_nm,
            torque_peak_nm: held.torque_peak_nm,
            capture_s: held.capture_s,
            impulse_torque_rms_nm: point.under_impulses.torque_rms_nm,
            impulse_torque_peak_nm: point.under_impulses.torque_peak_nm,
            impulse_capture_s: point.under_impulses.capture_s,
            rest_torque_rms_nm: point.to_rest.torque_rms_nm,
            rest_torque_peak_nm: point.to_rest.torque_peak_nm,
            rest_capture_s: point.to_rest.capture_s,
            diverges_at_s: held.diverges_at_s,
            yaw_rate_min_rad_per_s: held.yaw_rates_rad_per_s.map(|range| range.0),
            yaw_rate_max_rad_per_s: held.yaw_rates_rad_per_s.map(|range| range.1),
        }
    }
}
