//! Choices laid over a project that is known already, as where a virtual segment says who is where.
//!
//! ```toml
//! [network]
//! sync_window_ns = 500
//!
//! [[device]]             # one of those that are there, by its name
//! name = "T2"
//! clock = { assign_activate = 0x0300 }
//! ```
//! What may be chosen is what a project file may say; nothing but the name of a device must be said.

use toml::{Table, Value};

use super::{Project, ProjectError};

impl Project {
    /// This project with what `text` chooses: the tables of a project file. A `[[device]]` of it is one of
    /// those that are there, by its name; where that stands need not be said again.
    ///
    /// # Errors
    /// [`ProjectError`]: what is not TOML, not expected in a project, or names no device of this one.
    pub fn choose(&self, text: &str) -> Result<Self, ProjectError> {
        let form = |error: toml::de::Error| ProjectError::Form(error.to_string());
        let mut whole: Table = self.to_toml().parse().map_err(form)?;
        let mut choices: Table = text.parse().map_err(form)?;
        if let Some(Value::Array(devices)) = choices.remove("device") {
            let known = whole.get_mut("device").and_then(Value::as_array_mut);
            let known = known.map_or(&mut [][..], Vec::as_mut_slice);
            for device in devices {
                lay(known, device)?;
            }
        }
        whole.extend(choices);
        let project: Self = whole.try_into().map_err(form)?;
        project.tree()?;
        project.check()?;
        Ok(project)
    }
}

/// Lays what is chosen for one device over what is known of it.
fn lay(known: &mut [Value], choice: Value) -> Result<(), ProjectError> {
    let name = |device: &Value| device.get("name").and_then(Value::as_str).map(str::to_owned);
    let Some(named) = name(&choice) else {
        return Err(ProjectError::Form(
            "a [[device]] without `name`: whose choices are these?".to_owned(),
        ));
    };
    let device = known.iter_mut().find(|device| name(device).as_ref() == Some(&named));
    match (device, choice) {
        (Some(Value::Table(device)), Value::Table(choice)) => device.extend(choice),
        _ => {
            return Err(ProjectError::Value {
                whose: format!("device `{named}`"),
                reason: "there is none of that name".to_owned(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANT: &str = r#"
name = "plant"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T2"
type = "EL4102"
on = "K1.B"
"#;

    #[test]
    fn what_is_chosen_is_laid_over_what_is_known() {
        let plant = Project::parse(PLANT).unwrap();
        let chosen = plant.choose(
            "[network]\nsync_window_ns = 500\n[[device]]\nname = \"T2\"\nclock = { assign_activate = 0x0300 }\n",
        );
        let chosen = chosen.unwrap();
        assert_eq!(chosen.network.sync_window_ns, Some(500));
        assert_eq!(chosen.devices[0], plant.devices[0]);
        assert_eq!(chosen.devices[1].on, plant.devices[1].on);
        assert_eq!(chosen.devices[1].clock.as_ref().unwrap().assign_activate, Some(0x0300));
        assert_eq!(plant.choose(""), Ok(plant));
    }

    #[test]
    fn what_cannot_be_chosen_is_named() {
        let plant = Project::parse(PLANT).unwrap();
        for (text, expected) in [
            ("[network]\nsync_window = 5\n", "unknown field `sync_window`"),
            (
                "[[device]]\nname = \"T9\"\nstate = \"PREOP\"\n",
                "device `T9`: there is none of that name",
            ),
            ("[[device]]\nstate = \"PREOP\"\n", "without `name`"),
            ("[[device]]\nname = \"T2\"\nstate = \"RUN\"\n", "state `RUN`"),
            ("[network\n", "line 1"),
        ] {
            let error = plant.choose(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
