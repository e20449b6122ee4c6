//! The interface of the built program from outside: routes, leases, bad input, stream, recordings.

mod asking;
mod commands;
#[path = "../common/mod.rs"]
mod common;
mod errors;
mod events;
mod followed;
mod foxglove;
mod kept;
mod limits;
mod pages;
mod parts;
mod recordings;
mod retaken;
mod stream;
