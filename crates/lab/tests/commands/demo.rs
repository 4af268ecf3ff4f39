//! Ten seeds of the demo.

use linesman_lab::demo::{Demo, MIN_DEVICES};

#[test]
fn ten_seeds_of_the_demo_come_out_right() {
    let mut failed = Vec::new();
    for seed in 1..=10 {
        if let Err(what) = play(seed) {
            failed.push(format!("demo --seed {seed}: {what}"));
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

fn play(seed: u64) -> Result<(), String> {
    let mut demo = Demo::new(seed).map_err(|error| error.to_string())?;
    let tree = demo.lab().segment().tree();
    let junction = (0..tree.len()).any(|node| tree.children(node).count() >= 2);
    if tree.len() < MIN_DEVICES || !junction {
        return Err(format!("{} SubDevices, junction: {junction}", tree.len()));
    }
    assert_eq!(demo.drawing().iter().filter(|row| row.device.is_some()).count(), tree.len());
    demo.bring_up().map_err(|error| error.to_string())?;
    let mut count = 0;
    while let Some(episode) = demo.next_episode().map_err(|error| error.to_string())? {
        count += 1;
        if !episode.held() {
            return Err(format!("{}: {:?}", episode.entry, episode.verdict.map(|v| v.place)));
        }
    }
    if count < 4 { Err(format!("only {count} faults")) } else { Ok(()) }
}
