use linesman_lab::demo::Demo;
#[test]
fn zz() {
    let mut demo = Demo::new(1).unwrap();
    for row in demo.drawing() { eprintln!("{}", row.text); }
    demo.bring_up().unwrap();
    while let Some(e) = demo.next_episode().unwrap() {
        eprintln!("{} {} {:?} healed {:?}", e.entry, e.place, e.verdict.as_ref().map(|v| (&v.finding.code, v.finding.cause, &v.place, v.fits, v.cycles, v.others)), e.healed_in);
        let d = demo.lab().diagnosis();
        for f in d.findings { eprintln!("   {} {} {} {:?} {:?} {}..{:?} so {}", f.id, f.code, f.cause, f.place, f.state, f.opened_ns.0, f.closed_ns.map(|n| n.0), f.consequences.len()); 
          for c in &f.consequences { eprintln!("       so {} {} {} {:?}", c.id, c.code, c.cause, c.place); } }
    }
}
