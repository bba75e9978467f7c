//! bench

fn main(){}
