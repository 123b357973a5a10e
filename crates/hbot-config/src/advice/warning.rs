//! A warning about a scene, in the parts of which its sentence is made.

use core::fmt;

/// A warning about a scene. Its text is `EFFECT: WHAT: WHY; REMEDY`, without the parts that are
/// absent.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Warning {
    /// Id of the effect.
    pub effect: Option<String>,
    /// What it warns of.
    pub what: String,
    /// The values that lead to it.
    pub why: Option<String>,
    /// What to do about it: a phrase that begins with a verb.
    pub remedy: Option<String>,
    /// Whether the scene may shake the sphere.
    pub shakes: bool,
}

impl Warning {
    /// Returns a warning about an effect.
    pub(super) fn of(effect: &str, what: String) -> Self {
        Self { effect: Some(effect.to_owned()), what, ..Self::default() }
    }

    /// Returns a warning that is a single sentence.
    #[must_use]
    pub fn plain(what: String) -> Self {
        Self { what, ..Self::default() }
    }

    /// Returns what it warns of, with the effect.
    #[must_use]
    pub fn brief(&self) -> String {
        self.effect.iter().chain([&self.what]).map(String::as_str).collect::<Vec<_>>().join(": ")
    }

    /// Returns what it warns of and why, with the effect and without what to do.
    #[must_use]
    pub fn reason(&self) -> String {
        Self { remedy: None, ..self.clone() }.to_string()
    }

    /// Returns what to do about it, as a sentence.
    #[must_use]
    pub fn remedy_sentence(&self) -> Option<String> {
        let remedy = self.remedy.as_deref()?;
        let (first, rest) = remedy.split_at_checked(1)?;
        Some(format!("{}{rest}.", first.to_ascii_uppercase()))
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.brief())?;
        self.why.iter().try_for_each(|why| write!(f, ": {why}"))?;
        self.remedy.iter().try_for_each(|remedy| write!(f, "; {remedy}"))
    }
}

#[cfg(feature = "info")]
impl From<&Warning> for hbot_api::WarningParts {
    fn from(warning: &Warning) -> Self {
        let Warning { effect, what, why, shakes, .. } = warning.clone();
        Self { effect, what, why, remedy: warning.remedy_sentence(), shakes }
    }
}
