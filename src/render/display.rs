//! Shows images on a screen while they are rendered, by the protocol of the image viewer tev.

use std::io::{self, Write as _};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Mutex;
use std::time::Duration;

/// An observer of pixels as they are rendered, called by any thread.
pub trait Watcher: Sync {
    /// Receives the radiances of a rectangle of pixels, row by row, its first pixel at column `x` and row `y`.
    ///
    /// With final gather a rectangle is sent again after every round.
    fn pixels(&self, x: u32, y: u32, width: u32, height: u32, radiance: &[[f32; 3]]);
}

/// An observer that does nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Watcher for Unwatched {
    fn pixels(&self, _x: u32, _y: u32, _width: u32, _height: u32, _radiance: &[[f32; 3]]) {}
}

/// The time limit for a viewer to answer, and to accept pixels.
const PATIENCE: Duration = Duration::from_secs(5);

/// The kinds of packets that are sent.
const CREATE_IMAGE: u8 = 4;
const UPDATE_IMAGE: u8 = 6;

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// A running [tev](https://github.com/Tom94/tev) that shows an image as it is rendered.
///
/// Packets (little-endian): length of the whole packet as u32; kind as u8; then for a new image (4) focus as u8, name, width, height and number of channels as i32, their names;
/// for pixels (6) focus, name, number of channels, their names, x, y, width, height as i32, for every channel its offset and then for every channel its stride as i64, samples as f32.
/// Texts end with 0. The bytes are those of the viewer's own Python client (tevclient 1.0.4), and agree with the viewer's source (`Ipc.h`, `IpcPacket`); they were not tested with the viewer
/// itself. If the viewer disconnects, the rest is dropped: rendering does not wait for the display.
#[derive(Debug)]
pub struct TevDisplay {
    name: String,
    stream: Mutex<Option<TcpStream>>,
}

impl TevDisplay {
    /// Connects to HOST:PORT and opens an image of the given name there.
    ///
    /// # Errors
    /// An address that cannot be resolved, or at which no program listens.
    pub fn connect(address: &str, name: &str, width: u32, height: u32) -> io::Result<Self> {
        let mut failure = io::Error::new(io::ErrorKind::NotFound, "the address has no host");
        for place in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&place, PATIENCE) {
                Ok(mut stream) => {
                    stream.set_write_timeout(Some(PATIENCE))?;
                    // A zero would end the text of the name.
                    let name = name.replace('\0', " ");
                    let mut packet = Packet::new(CREATE_IMAGE, true, &name);
                    packet.numbers(&[width, height]);
                    packet.channels();
                    stream.write_all(&packet.finished()?)?;
                    let stream = Mutex::new(Some(stream));
                    return Ok(Self { name, stream });
                }
                Err(error) => failure = error,
            }
        }
        Err(failure)
    }

    /// Returns whether the viewer accepted all packets so far.
    #[must_use]
    pub fn is_connected(&self) -> bool {
        self.stream.lock().is_ok_and(|stream| stream.is_some())
    }
}

impl Watcher for TevDisplay {
    fn pixels(&self, x: u32, y: u32, width: u32, height: u32, radiance: &[[f32; 3]]) {
        let mut packet = Packet::new(UPDATE_IMAGE, false, &self.name);
        packet.channels();
        packet.numbers(&[x, y, width, height]);
        for number in [0_i64, 1, 2, 3, 3, 3] {
            packet.0.extend(number.to_le_bytes());
        }
        for value in radiance.iter().flatten() {
            packet.0.extend(value.to_le_bytes());
        }
        let Ok(mut stream) = self.stream.lock() else { return };
        let sent = stream
            .as_mut()
            .map(|stream| packet.finished().and_then(|bytes| stream.write_all(&bytes)));
        if sent.is_some_and(|sent| sent.is_err()) {
            *stream = None;
        }
    }
}

/// The bytes of a packet; the first four are for its length.
struct Packet(Vec<u8>);

impl Packet {
    fn new(kind: u8, focus: bool, name: &str) -> Self {
        let mut packet = Self(vec![0, 0, 0, 0, kind, u8::from(focus)]);
        packet.text(name);
        packet
    }

    fn text(&mut self, text: &str) {
        self.0.extend(text.bytes());
        self.0.push(0);
    }

    /// Appends numbers below 2³¹, for which signed and unsigned integers have the same bytes.
    fn numbers(&mut self, numbers: &[u32]) {
        for number in numbers {
            self.0.extend(number.to_le_bytes());
        }
    }

    fn channels(&mut self) {
        self.numbers(&[3]);
        for channel in CHANNELS {
            self.text(channel);
        }
    }

    fn finished(mut self) -> io::Result<Vec<u8>> {
        let length = u32::try_from(self.0.len()).map_err(|_| io::Error::other("a packet of more than 4 GiB"))?;
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        Ok(self.0)
    }
}
