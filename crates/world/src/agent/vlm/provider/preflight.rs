//! The check that a provider can be reached, before anything is recorded or paid for.
//!
//! Rule: a connection and nothing over it: no request, no key, no handshake. Where requests go through a proxy, the proxy
//! is the one to be reached, and the first request finds out.

use std::io;
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use reqwest::Url;

/// The variables by which requests are sent through a proxy.
const PROXIES: [&str; 6] = ["HTTP_PROXY", "http_proxy", "HTTPS_PROXY", "https_proxy", "ALL_PROXY", "all_proxy"];

/// A provider without a connection.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot connect to {address}: {fault}\n  help: is the address right, and the server running? nothing was sent or recorded"
)]
pub struct Unreachable {
    /// Scheme, host and port.
    pub address: String,
    /// The error of the operating system.
    pub fault: String,
}

/// Connects to the host of an address, in this time at most.
pub(super) fn connect(url: &Url, patience: Duration) -> Result<(), Unreachable> {
    if PROXIES.iter().any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty())) {
        return Ok(());
    }
    let unreachable =
        |fault: io::Error| Unreachable { address: url.origin().ascii_serialization(), fault: fault.to_string() };
    let addresses = url.socket_addrs(|| None).map_err(unreachable)?;
    first_of(&addresses, patience).map_err(unreachable)
}

/// A connection to the first of these that takes one.
fn first_of(addresses: &[SocketAddr], patience: Duration) -> io::Result<()> {
    let each = patience / u32::try_from(addresses.len().max(1)).unwrap_or(u32::MAX);
    let mut fault = io::Error::other("its name has no address");
    for address in addresses {
        match TcpStream::connect_timeout(address, each) {
            Ok(_) => return Ok(()),
            Err(error) => fault = error,
        }
    }
    Err(fault)
}
