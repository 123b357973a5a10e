//! Numbers with a unit, as people read them off drawings and data sheets.

/// What a number measures, and with it its units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    /// m.
    Length,
    /// kg.
    Mass,
    /// Degrees.
    Angle,
    /// N m.
    Torque,
    /// N.
    Force,
    /// A ratio, without a unit.
    Ratio,
}

impl Quantity {
    /// Returns the units: the name, and how many of the first unit so many of it are, as a
    /// fraction.
    const fn units(self) -> &'static [(&'static str, f64, f64)] {
        match self {
            Self::Length => &[("m", 1.0, 1.0), ("cm", 1.0, 100.0), ("mm", 1.0, 1000.0)],
            Self::Mass => &[("kg", 1.0, 1.0), ("g", 1.0, 1000.0)],
            Self::Angle => &[("deg", 1.0, 1.0), ("°", 1.0, 1.0), ("rad", 180.0, std::f64::consts::PI)],
            Self::Torque => &[("Nm", 1.0, 1.0), ("Ncm", 1.0, 100.0), ("mNm", 1.0, 1000.0)],
            Self::Force => &[("N", 1.0, 1.0)],
            Self::Ratio => &[(":1", 1.0, 1.0)],
        }
    }

    /// Reads a number with or without a unit, such as `0.06` or `60 mm`. Without one it is in the
    /// first unit.
    ///
    /// # Errors
    /// Fails with what is wrong if the text is no number, or if its unit measures something else.
    pub(super) fn read(self, text: &str) -> Result<f64, String> {
        let text: String = text.chars().filter(|c| !c.is_whitespace()).collect();
        if let Ok(number) = text.parse() {
            return Ok(number);
        }
        if text.contains(',') {
            return Err(format!("write a decimal point: {}", text.replace(',', ".")));
        }
        // The longest unit at the end: `mm` before `m`.
        let found = self.units().iter().filter(|(name, ..)| text.ends_with(name));
        let Some((name, by, of)) = found.max_by_key(|(name, ..)| name.len()) else {
            return Err(self.legal());
        };
        let number = text[..text.len() - name.len()].parse::<f64>().map_err(|_| self.legal())?;
        Ok(number * by / of)
    }

    fn legal(self) -> String {
        let names: Vec<_> = self.units().iter().map(|(name, ..)| *name).collect();
        match self {
            Self::Ratio => "one number without a unit: 17 for 17:1".to_owned(),
            _ => format!("a number, with or without a unit: {}", names.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_the_unit_of_the_drawing() {
        for (quantity, text, value) in [
            (Quantity::Length, "60 mm", 0.06),
            (Quantity::Length, "10.2cm", 0.102),
            (Quantity::Length, "0.102", 0.102),
            (Quantity::Length, "1 m", 1.0),
            (Quantity::Mass, "467 g", 0.467),
            (Quantity::Mass, "0.467 kg", 0.467),
            (Quantity::Angle, "10°", 10.0),
            (Quantity::Torque, "140 mN m", 0.14),
            (Quantity::Torque, "14 N cm", 0.14),
            (Quantity::Force, "10 N", 10.0),
            (Quantity::Ratio, "17:1", 17.0),
        ] {
            assert_eq!(quantity.read(text), Ok(value), "{text}");
        }
        assert!((Quantity::Angle.read("0.5 rad").unwrap() - 0.5_f64.to_degrees()).abs() < 1.0e-12);
        assert!(Quantity::Length.read("0,06").unwrap_err().contains("decimal point: 0.06"));
        for wrong in ["60 kg", "mm", "", "x m"] {
            assert!(Quantity::Length.read(wrong).unwrap_err().contains("m, cm, mm"), "{wrong}");
        }
    }
}
