//! x
use std::time::Instant;
fn main(){ for f in ["bare","simple","mailbox","cut-off"]{ let d=std::fs::read(format!("corpus/sii/{f}")).unwrap();
 let t=Instant::now(); for _ in 0..100{ let i=linesman_proto::sii::Image::parse(&d).unwrap(); let _=i.build();} println!("{f} {} parse+build {:?}",d.len(),t.elapsed()/100);
 let t=Instant::now(); for _ in 0..100{ linesman_fuzz::sii(&d);} println!("all {:?}",t.elapsed()/100);
 let t=Instant::now(); for _ in 0..100{ let i=linesman_proto::sii::Image::parse(&d).unwrap(); let b=i.build().unwrap(); std::hint::black_box(b.len()); } println!("len {}", linesman_proto::sii::Image::parse(&d).unwrap().build().unwrap().len()); let _=t;
}}
