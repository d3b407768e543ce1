//! Settings that form-factor methods and solvers declare: names, values, defaults.
//!
//! A method or solver lists its settings beside its name. The flags of the command line, their help, the settings in results and the refusal of unused
//! settings follow from these lists.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;

use serde::{Serialize, Serializer};

/// A setting that some methods or solvers use.
#[derive(Debug, PartialEq, Eq)]
pub struct Setting {
    /// The name in files of results, in snake case; a flag of the command line has `-` for `_`.
    pub name: &'static str,
    /// Its help, in a few words.
    pub help: &'static str,
    /// The placeholder of its value in help.
    pub letter: &'static str,
    /// Its values.
    pub kind: Kind,
}

/// The values that a setting has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// On or off; off by default.
    Flag,
    /// Whole numbers from 1 to this one.
    Count(u64),
    /// Finite numbers, within the range of the method or solver.
    Number,
    /// One of these words, each with its meaning.
    Choice(&'static [(&'static str, &'static str)]),
}

/// The value of a setting.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// On or off.
    Flag(bool),
    /// A whole number.
    Count(u64),
    /// A number.
    Number(f64),
    /// A word.
    Choice(&'static str),
}

/// A setting in the list of a method or solver.
#[derive(Clone, Copy, Debug)]
pub struct Use {
    /// The setting.
    pub setting: &'static Setting,
    /// The default; `None` if the method or solver chooses a value.
    pub default: Option<Value>,
}

/// The values of some settings.
#[derive(Clone, Debug, Default)]
pub struct Values(BTreeMap<&'static str, (&'static Setting, Value)>);

impl Setting {
    /// Returns a use of the setting with a default.
    #[must_use]
    pub const fn or(&'static self, default: Value) -> Use {
        Use {
            setting: self,
            default: Some(default),
        }
    }

    /// Returns a use of the setting without a default.
    #[must_use]
    pub const fn optional(&'static self) -> Use {
        Use {
            setting: self,
            default: None,
        }
    }

    /// Reads a value.
    ///
    /// # Errors
    /// The possible values, as advice.
    pub fn parse(&self, text: &str) -> Result<Value, String> {
        match self.kind {
            Kind::Flag => text
                .parse()
                .map(Value::Flag)
                .map_err(|_| "give true or false".to_owned()),
            Kind::Count(most) => match text.parse() {
                Ok(count) if (1..=most).contains(&count) => Ok(Value::Count(count)),
                _ if most == u64::MAX => Err("give a number from 1".to_owned()),
                _ => Err(format!("give a number from 1 to {most}")),
            },
            Kind::Number => match text.parse::<f64>() {
                Ok(number) if number.is_finite() => Ok(Value::Number(number)),
                _ => Err("give a finite number".to_owned()),
            },
            Kind::Choice(words) => {
                let known = words.iter().map(|(word, _)| *word);
                let found = known.clone().find(|word| *word == text);
                found.map(Value::Choice).ok_or_else(|| {
                    let known: Vec<&str> = known.collect();
                    format!("give one of {}", known.join(", "))
                })
            }
        }
    }

    /// Returns whether the setting can have a value.
    fn has(&self, value: Value) -> bool {
        match (self.kind, value) {
            (Kind::Flag, Value::Flag(_)) | (Kind::Number, Value::Number(_)) => true,
            (Kind::Count(most), Value::Count(count)) => (1..=most).contains(&count),
            (Kind::Choice(words), Value::Choice(word)) => words.iter().any(|(known, _)| *known == word),
            _ => false,
        }
    }

    /// Returns the help of a flag: its meaning, and the defaults of its users, each a name with its use.
    #[must_use]
    pub fn described(&self, users: &[(&str, Use)]) -> String {
        let mut groups: Vec<(Option<Value>, Vec<&str>)> = Vec::new();
        for (name, used) in users {
            match groups.iter_mut().find(|(default, _)| *default == used.default) {
                Some((_, names)) => names.push(name),
                None => groups.push((used.default, vec![name])),
            }
        }
        let groups = groups.iter().map(|(default, names)| match default {
            Some(default) if self.kind != Kind::Flag => format!("{} [default: {default}]", listed(names)),
            _ => listed(names),
        });
        let groups: Vec<String> = groups.collect();
        format!("{}, with {}", self.help, groups.join(", with "))
    }
}

/// Returns the settings of some lists, each once and in order, with the names and uses of the lists that contain it.
#[must_use]
pub fn gathered<'a>(
    lists: impl IntoIterator<Item = (&'a str, &'static [Use])>,
) -> Vec<(&'static Setting, Vec<(&'a str, Use)>)> {
    let mut settings: Vec<(&Setting, Vec<(&str, Use)>)> = Vec::new();
    for (name, list) in lists {
        for used in list {
            match settings
                .iter_mut()
                .find(|(setting, _)| setting.name == used.setting.name)
            {
                Some((_, users)) => users.push((name, *used)),
                None => settings.push((used.setting, vec![(name, *used)])),
            }
        }
    }
    settings
}

/// Returns names in backticks, separated by commas.
pub(crate) fn ticked<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// Returns names in the form `a, b and c`.
fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [name] => (*name).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

impl Value {
    /// Returns a whole number.
    #[must_use]
    pub fn count(self) -> Option<u64> {
        match self {
            Self::Count(count) => Some(count),
            _ => None,
        }
    }

    /// Returns a whole number above 0 as a count of things in memory.
    #[must_use]
    pub fn size(self) -> Option<NonZeroUsize> {
        usize::try_from(self.count()?).ok().and_then(NonZeroUsize::new)
    }

    /// Returns a number.
    #[must_use]
    pub fn number(self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(number),
            _ => None,
        }
    }

    /// Returns a word.
    #[must_use]
    pub fn choice(self) -> Option<&'static str> {
        match self {
            Self::Choice(word) => Some(word),
            _ => None,
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Flag(flag) => flag.fmt(f),
            Self::Count(count) => count.fmt(f),
            Self::Number(number) => write!(f, "{number:?}"),
            Self::Choice(word) => word.fmt(f),
        }
    }
}

impl From<bool> for Value {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

impl From<u64> for Value {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl From<NonZeroUsize> for Value {
    fn from(count: NonZeroUsize) -> Self {
        Self::Count(count.get() as u64)
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<&'static str> for Value {
    fn from(word: &'static str) -> Self {
        Self::Choice(word)
    }
}

impl Values {
    /// Returns the values with another one, which replaces an earlier value of the setting.
    ///
    /// # Panics
    /// If the setting cannot have the value.
    #[must_use]
    pub fn with(mut self, setting: &'static Setting, value: impl Into<Value>) -> Self {
        self.set(setting, value);
        self
    }

    /// Sets a value, which replaces an earlier value of the setting.
    ///
    /// # Panics
    /// If the setting cannot have the value.
    pub fn set(&mut self, setting: &'static Setting, value: impl Into<Value>) {
        let value = value.into();
        assert!(
            setting.has(value),
            "`{value}` is no value of the setting `{}`",
            setting.name
        );
        self.0.insert(setting.name, (setting, value));
    }

    /// Removes the value of a setting.
    pub fn remove(&mut self, setting: &Setting) {
        self.0.remove(setting.name);
    }

    /// Adds all values of `others`, which replace earlier ones.
    pub fn extend(&mut self, others: &Self) {
        self.0
            .extend(others.iter().map(|(setting, value)| (setting.name, (setting, value))));
    }

    /// Returns the value of a setting, if there is one.
    #[must_use]
    pub fn get(&self, setting: &Setting) -> Option<Value> {
        self.0.get(setting.name).map(|(_, value)| *value)
    }

    /// Returns whether a flag is on.
    #[must_use]
    pub fn is_on(&self, setting: &Setting) -> bool {
        self.get(setting) == Some(Value::Flag(true))
    }

    /// Returns all values, by the names of their settings.
    pub fn iter(&self) -> impl Iterator<Item = (&'static Setting, Value)> + '_ {
        self.0.values().copied()
    }

    /// Returns the first given setting that is not in use; a flag that is off counts as not given.
    #[must_use]
    pub fn unused(&self, uses: &[Use]) -> Option<&'static Setting> {
        let in_use = |setting: &Setting| uses.iter().any(|used| used.setting.name == setting.name);
        self.iter()
            .find(|(setting, value)| *value != Value::Flag(false) && !in_use(setting))
            .map(|(setting, _)| setting)
    }

    /// Returns the values of the settings in use: the given ones, else the defaults.
    #[must_use]
    pub fn resolved(&self, uses: &[Use]) -> Self {
        let own = |used: &Use| self.get(used.setting).or(used.default);
        let all = uses.iter().filter_map(|used| Some((used.setting, own(used)?)));
        Self(all.map(|(setting, value)| (setting.name, (setting, value))).collect())
    }
}

impl PartialEq for Values {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl Serialize for Values {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().map(|(setting, value)| (setting.name, value)))
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    static RAYS: Setting = Setting {
        name: "rays",
        help: "Rays",
        letter: "N",
        kind: Kind::Count(100),
    };
    static WORDS: Setting = Setting {
        name: "words",
        help: "Words",
        letter: "WORD",
        kind: Kind::Choice(&[("few", "Few"), ("many", "Many")]),
    };

    #[test]
    fn values_are_read_and_checked() {
        assert_eq!(RAYS.parse("100"), Ok(Value::Count(100)));
        for wrong in ["0", "101", "-1", "x", ""] {
            assert_eq!(RAYS.parse(wrong).unwrap_err(), "give a number from 1 to 100");
        }
        assert_eq!(WORDS.parse("many"), Ok(Value::Choice("many")));
        assert_eq!(WORDS.parse("Many").unwrap_err(), "give one of few, many");
    }

    #[test]
    #[should_panic(expected = "`101` is no value of the setting `rays`")]
    fn values_out_of_range_panic() {
        Values::default().set(&RAYS, 101_u64);
    }

    #[test]
    fn defaults_follow_what_is_given() {
        let uses = [RAYS.or(Value::Count(7)), WORDS.optional()];
        let given = Values::default().with(&WORDS, "few");
        let resolved = given.resolved(&uses);
        assert_eq!(resolved.get(&RAYS), Some(Value::Count(7)));
        assert_eq!(resolved.get(&WORDS), Some(Value::Choice("few")));
        assert_eq!(given.unused(&uses[..1]), Some(&WORDS));
        assert_eq!(given.unused(&uses), None);
        assert_eq!(serde_json::to_string(&resolved).unwrap(), r#"{"rays":7,"words":"few"}"#);
    }

    #[test]
    fn help_names_defaults_and_users() {
        let seven = RAYS.or(Value::Count(7));
        let users = [
            ("a", seven),
            ("b", RAYS.or(Value::Count(9))),
            ("c", seven),
            ("d", seven),
        ];
        assert_eq!(
            RAYS.described(&users),
            "Rays, with a, c and d [default: 7], with b [default: 9]"
        );
    }
}
