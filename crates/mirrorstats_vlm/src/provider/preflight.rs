//! The check that a provider can be reached, before recording or paying.
//!
//! Rule: it only opens a connection and sends nothing: no request, no key, no handshake. With a proxy, reaching the
//! provider is the proxy's task, and only the first request shows whether it can.

use std::io;
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use reqwest::Url;

const PROXIES: [&str; 6] = ["HTTP_PROXY", "http_proxy", "HTTPS_PROXY", "https_proxy", "ALL_PROXY", "all_proxy"];

#[derive(Debug, thiserror::Error)]
#[error(
    "cannot connect to {address}: {fault}\n  help: is the address right, and the server running? nothing was sent or recorded"
)]
pub struct Unreachable {
    /// Scheme, host and port.
    pub address: String,
    pub fault: String,
}

pub(super) fn connect(url: &Url, patience: Duration) -> Result<(), Unreachable> {
    if PROXIES.iter().any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty())) {
        return Ok(());
    }
    let unreachable =
        |fault: io::Error| Unreachable { address: url.origin().ascii_serialization(), fault: fault.to_string() };
    let addresses = url.socket_addrs(|| None).map_err(unreachable)?;
    first_of(&addresses, patience).map_err(unreachable)
}

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
