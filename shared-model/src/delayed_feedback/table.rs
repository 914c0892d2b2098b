//! The ECU's delayed feedback.
//!
//! Made by `sim-host feedback --from 1560 --to 2000 --step 20 --gain-from 0.5 --gain-to 12
//! --gain-step 0.25 --latency 2 --table FILE`; not to be edited by hand. Parameters: the paper's
//! (preset `reconstruction`).
//!
//! After each period is its speed, after each gain the orbit's greatest multiplier beside 1 without
//! and with feedback.

use super::schedule::OrbitSchedule;

/// Wheel speeds of a schedule.
pub const POINTS: usize = 23;

/// Without dither.
pub const UNDITHERED: OrbitSchedule<f32, POINTS> = OrbitSchedule {
    motor_current_a: 10.0,
    first_rpm: 1560.0,
    step_rpm: 20.0,
    periods_s: [
        1.58651, // 1560 rpm
        1.59322, // 1580 rpm
        1.60083, // 1600 rpm
        1.60933, // 1620 rpm
        1.61873, // 1640 rpm
        1.62903, // 1660 rpm
        1.64022, // 1680 rpm
        1.65232, // 1700 rpm
        1.66535, // 1720 rpm
        1.67930, // 1740 rpm
        1.69422, // 1760 rpm
        1.71012, // 1780 rpm
        1.72702, // 1800 rpm
        1.74498, // 1820 rpm
        1.76403, // 1840 rpm
        1.78422, // 1860 rpm
        1.80563, // 1880 rpm
        1.82834, // 1900 rpm
        1.85245, // 1920 rpm
        1.87809, // 1940 rpm
        1.90543, // 1960 rpm
        1.93467, // 1980 rpm
        1.96609, // 2000 rpm
    ],
    gains: [
        6.25, // 1560 rpm: -0.70 to 0.17
        6.25, // 1580 rpm: -0.76 to 0.18
        6.25, // 1600 rpm: -0.83 to 0.19
        6.25, // 1620 rpm: -0.91 to 0.20
        6.25, // 1640 rpm: -1.00 to 0.21
        6.00, // 1660 rpm: -1.10 to 0.22
        6.00, // 1680 rpm: -1.22 to 0.23
        6.00, // 1700 rpm: -1.35 to 0.25
        6.00, // 1720 rpm: -1.49 to 0.26
        5.75, // 1740 rpm: -1.66 to 0.27
        5.75, // 1760 rpm: -1.85 to 0.29
        5.50, // 1780 rpm: -2.08 to 0.30
        5.50, // 1800 rpm: -2.34 to 0.33
        5.50, // 1820 rpm: -2.65 to 0.35
        5.25, // 1840 rpm: -3.01 to 0.37
        5.25, // 1860 rpm: -3.44 to 0.40
        5.00, // 1880 rpm: -3.95 to 0.42
        4.75, // 1900 rpm: -4.57 to 0.45
        4.75, // 1920 rpm: -5.33 to 0.49
        4.50, // 1940 rpm: -6.26 to 0.53
        4.25, // 1960 rpm: -7.40 to 0.56
        4.00, // 1980 rpm: -8.85 to 0.62
        3.75, // 2000 rpm: -10.68 to 0.65
    ],
};

/// Under the square dither of the ECU's schedule, which holds the orbit by itself.
pub const DITHERED: OrbitSchedule<f32, POINTS> = OrbitSchedule {
    motor_current_a: 10.0,
    first_rpm: 1560.0,
    step_rpm: 20.0,
    periods_s: [
        1.17128, // 1560 rpm
        1.16602, // 1580 rpm
        1.16087, // 1600 rpm
        1.15715, // 1620 rpm
        1.15113, // 1640 rpm
        1.14574, // 1660 rpm
        1.14071, // 1680 rpm
        1.13602, // 1700 rpm
        1.13269, // 1720 rpm
        1.12789, // 1740 rpm
        1.12343, // 1760 rpm
        1.11980, // 1780 rpm
        1.11572, // 1800 rpm
        1.11273, // 1820 rpm
        1.10776, // 1840 rpm
        1.10413, // 1860 rpm
        1.10005, // 1880 rpm
        1.09652, // 1900 rpm
        1.09380, // 1920 rpm
        1.09038, // 1940 rpm
        1.08701, // 1960 rpm
        1.08419, // 1980 rpm
        1.08166, // 2000 rpm
    ],
    gains: [
        1.00, // 1560 rpm: -0.30 to 0.30
        1.00, // 1580 rpm: -0.31 to 0.31
        1.00, // 1600 rpm: -0.32 to 0.32
        1.00, // 1620 rpm: -0.34 to 0.33
        1.00, // 1640 rpm: -0.34 to 0.34
        1.00, // 1660 rpm: -0.34 to 0.34
        1.00, // 1680 rpm: -0.35 to 0.35
        1.00, // 1700 rpm: -0.36 to 0.35
        1.00, // 1720 rpm: -0.37 to 0.37
        1.00, // 1740 rpm: -0.37 to 0.37
        1.00, // 1760 rpm: -0.38 to 0.38
        1.00, // 1780 rpm: -0.39 to 0.39
        1.00, // 1800 rpm: -0.40 to 0.39
        1.00, // 1820 rpm: -0.41 to 0.41
        1.00, // 1840 rpm: -0.41 to 0.40
        1.00, // 1860 rpm: -0.41 to 0.41
        1.00, // 1880 rpm: -0.42 to 0.41
        1.00, // 1900 rpm: -0.42 to 0.42
        1.00, // 1920 rpm: -0.44 to 0.43
        1.00, // 1940 rpm: -0.44 to 0.44
        1.00, // 1960 rpm: -0.45 to 0.44
        1.00, // 1980 rpm: -0.46 to 0.45
        1.00, // 2000 rpm: -0.47 to 0.46
    ],
};
