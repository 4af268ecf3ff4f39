//! Project files.

use linesman_config::project::Project;

/// Any text may be a project. What can be read is written so that it reads as the same project, and is
/// planned or refused in words.
pub fn project(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(project) = Project::parse(text) else { return };
    assert_eq!(Project::parse(&project.to_toml()).as_ref(), Ok(&project));
    match project.plan(&mut |_| Ok(None)) {
        Ok(plan) => {
            let _ = plan.doubts();
            for frame in plan.tasks.iter().flat_map(|task| &task.frames) {
                assert!(frame.size() <= linesman_proto::ethernet::MAX_LEN);
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}
