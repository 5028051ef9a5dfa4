//! Spark settings as typed, `key=value`, and which of them are secrets.

use std::fmt;
use std::str::FromStr;

/// One setting. Its value is never shown, neither in messages nor in `{:?}`.
#[derive(Clone, PartialEq, Eq)]
pub struct Setting {
    key: String,
    value: String,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SettingError {
    #[error("expected `spark.key=value`")]
    Form,
    #[error("`{key}` cannot be set: {why}")]
    Fixed { key: String, why: &'static str },
}

/// Keys that would break the driver's assumptions.
const FIXED: [(&str, &str); 2] = [
    ("spark.submit.deployMode", "the driver runs here, where the answer is read"),
    ("spark.master", "give the master with --master"),
];

impl Setting {
    pub fn key(&self) -> &str {
        &self.key
    }

    pub(super) fn value(&self) -> &str {
        &self.value
    }

    /// Returns true if the value must not appear on a command line, which other users of this machine can read.
    pub(super) fn is_secret(&self) -> bool {
        let key = self.key.to_ascii_lowercase();
        ["secret", "password", "token", "credential", "access.key", "accesskey", "account.key", "apikey", "api.key"]
            .iter()
            .any(|word| key.contains(word))
    }
}

impl fmt::Debug for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}=...", self.key)
    }
}

impl FromStr for Setting {
    type Err = SettingError;

    fn from_str(text: &str) -> Result<Self, SettingError> {
        let (key, value) = text.split_once('=').ok_or(SettingError::Form)?;
        let key = key.trim();
        if !key.starts_with("spark.") || key.contains(char::is_whitespace) {
            return Err(SettingError::Form);
        }
        match FIXED.iter().find(|(fixed, _)| *fixed == key) {
            Some((_, why)) => Err(SettingError::Fixed { key: key.to_owned(), why }),
            None => Ok(Self { key: key.to_owned(), value: value.to_owned() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Setting;

    #[test]
    fn a_setting_is_split_at_the_first_equals_sign() {
        let setting: Setting = "spark.driver.extraJavaOptions=-Da=b -Dc=d".parse().unwrap();
        assert_eq!((setting.key(), setting.value()), ("spark.driver.extraJavaOptions", "-Da=b -Dc=d"));
        for wrong in
            ["", "spark.x", "=1", "x=1", "spark.a b=1", "spark.master=local", "spark.submit.deployMode=cluster"]
        {
            assert!(wrong.parse::<Setting>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn secrets_are_known_by_their_keys_and_never_shown() {
        for (text, secret) in [
            ("spark.hadoop.fs.s3a.secret.key=hush", true),
            ("spark.hadoop.fs.s3a.access.key=hush", true),
            ("spark.hadoop.fs.azure.account.key.x.net=hush", true),
            ("spark.ssl.keyPassword=hush", true),
            ("spark.executor.memory=hush", false),
        ] {
            let setting: Setting = text.parse().unwrap();
            assert_eq!(setting.is_secret(), secret, "{text}");
            assert!(!format!("{setting:?}").contains("hush"));
        }
    }
}
