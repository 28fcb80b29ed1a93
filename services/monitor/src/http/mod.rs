//! The server of the page and of the metrics.
//!
//! Bounded in everything: connections, bytes and seconds of a request's head, bytes of its body. Who asks under a foreign
//! name, or from a page of another origin, is refused before anything is looked at.

mod control;
mod guard;
mod live;
mod page;
mod server;

pub(crate) use guard::Guard;
pub(crate) use server::{Server, bind, local_ip};
