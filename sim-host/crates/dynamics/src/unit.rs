//! Units, by the ends of the names that carry them.

/// A unit, as a product of powers of SI base units.
#[derive(Debug, PartialEq)]
pub struct Unit {
    /// End of the names of quantities in this unit.
    suffix: &'static str,
    /// Its symbol.
    pub symbol: &'static str,
    /// Exponents of kg, m, s, A and rad.
    exponents: [i8; 5],
    /// Size in the product of base units.
    pub factor: f64,
}

/// Names of the base units in a model description.
const BASE: [&str; 5] = ["kg", "m", "s", "A", "rad"];

const fn unit(suffix: &'static str, symbol: &'static str, exponents: [i8; 5]) -> Unit {
    Unit {
        suffix,
        symbol,
        exponents,
        factor: 1.0,
    }
}

const RPM: f64 = std::f64::consts::TAU / 60.0;

/// All units. Where the end of a name fits several, the longest counts.
pub const ALL: [Unit; 25] = [
    unit("_m", "m", [0, 1, 0, 0, 0]),
    unit("_m_per_s2", "m/s^2", [0, 1, -2, 0, 0]),
    unit("_kg", "kg", [1, 0, 0, 0, 0]),
    unit("_kg_m2", "kg.m^2", [1, 2, 0, 0, 0]),
    unit("_s", "s", [0, 0, 1, 0, 0]),
    unit("_per_s", "1/s", [0, 0, -1, 0, 0]),
    unit("_hz", "Hz", [0, 0, -1, 0, 0]),
    unit("_n", "N", [1, 1, -2, 0, 0]),
    unit("_nm", "N.m", [1, 2, -2, 0, 0]),
    unit("_nm_per_s", "N.m/s", [1, 2, -3, 0, 0]),
    unit("_nm_per_a", "N.m/A", [1, 2, -2, -1, 0]),
    unit("_nm_s_per_rad", "N.m.s/rad", [1, 2, -1, 0, -1]),
    unit("_a", "A", [0, 0, 0, 1, 0]),
    unit("_a_per_s", "A/s", [0, 0, -1, 1, 0]),
    unit("_v", "V", [1, 2, -3, -1, 0]),
    unit("_v_per_s", "V/s", [1, 2, -4, -1, 0]),
    unit("_ohm", "Ohm", [1, 2, -3, -2, 0]),
    unit("_rad", "rad", [0, 0, 0, 0, 1]),
    unit("_per_rad", "1/rad", [0, 0, 0, 0, -1]),
    unit("_rad_per_s", "rad/s", [0, 0, -1, 0, 1]),
    unit("_rad_per_s2", "rad/s^2", [0, 0, -2, 0, 1]),
    unit("_rad_per_volt", "rad/V", [-1, -2, 3, 1, 1]),
    unit("_s3_per_rad2", "s^3/rad^2", [0, 0, 3, 0, -2]),
    Unit {
        suffix: "_rpm",
        symbol: "rpm",
        exponents: [0, 0, -1, 0, 1],
        factor: RPM,
    },
    Unit {
        suffix: "_rpm_per_s",
        symbol: "rpm/s",
        exponents: [0, 0, -2, 0, 1],
        factor: RPM,
    },
];

impl Unit {
    /// The unit of a quantity of that name; `None` if the name carries none.
    ///
    /// ```
    /// use dynamics::unit::Unit;
    /// let symbol = |name| Unit::of(name).map(|unit| unit.symbol);
    /// assert_eq!(symbol("steering.damping_nm_s_per_rad"), Some("N.m.s/rad"));
    /// assert_eq!(symbol("tires.front.stiffness_per_rad"), Some("1/rad"));
    /// assert_eq!(symbol("steering.ratio"), None);
    /// ```
    pub fn of(name: &str) -> Option<&'static Self> {
        let fits = ALL.iter().filter(|unit| name.ends_with(unit.suffix));
        fits.max_by_key(|unit| unit.suffix.len())
    }

    /// The base units that it has, with their exponents.
    pub fn base(&self) -> impl Iterator<Item = (&'static str, i8)> {
        let powers = BASE.into_iter().zip(self.exponents);
        powers.filter(|(_, exponent)| *exponent != 0)
    }
}
