//! A picture on a viewer while it is rendered, against a server that reads packets as the viewer does.

use std::io::Read;
use std::net::{TcpListener, TcpStream};

use radiosity::progress::Silent;
use radiosity::render::display::{TevDisplay, Watcher as _};
use radiosity::render::{DirectMethod, GatherSettings, RenderSettings, UnfoldedView, View, render_watched};
use radiosity::visibility::embree::EmbreeVisibility;

use super::scenes::{Solved, bright_cube};

/// Takes one field after another off a packet.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = self.0.split_first_chunk::<N>().unwrap();
        self.0 = rest;
        *head
    }

    fn i32(&mut self) -> usize {
        usize::try_from(i32::from_le_bytes(self.take())).unwrap()
    }

    fn i64(&mut self) -> usize {
        usize::try_from(i64::from_le_bytes(self.take())).unwrap()
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&byte| byte == 0).unwrap();
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }

    fn channels(&mut self) -> String {
        let n = self.i32();
        (0..n).map(|_| self.text()).collect()
    }
}

/// What the viewer shows in the end.
#[derive(Default)]
struct Shown {
    name: String,
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
    n_updates: usize,
}

fn serve(mut stream: TcpStream) -> Shown {
    let mut shown = Shown::default();
    let mut length = [0; 4];
    while stream.read_exact(&mut length).is_ok() {
        let mut packet = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut packet).unwrap();
        let mut fields = Fields(&packet);
        let [kind, focus] = fields.take();
        let name = fields.text();
        match kind {
            4 => {
                (shown.width, shown.height) = (fields.i32(), fields.i32());
                assert_eq!((focus, fields.channels().as_str()), (1, "RGB"));
                shown.name = name;
                shown.pixels = vec![[f32::NAN; 3]; shown.width * shown.height];
            }
            6 => {
                assert_eq!((focus, fields.channels().as_str(), &name), (0, "RGB", &shown.name));
                let [x, y, width, height] = [(); 4].map(|()| fields.i32());
                let offsets = [(); 3].map(|()| fields.i64());
                let strides = [(); 3].map(|()| fields.i64());
                let values: Vec<f32> = (0..3 * width * height)
                    .map(|_| f32::from_le_bytes(fields.take()))
                    .collect();
                for k in 0..width * height {
                    let at = (y + k / width) * shown.width + x + k % width;
                    shown.pixels[at] = [0, 1, 2].map(|c| values[offsets[c] + k * strides[c]]);
                }
                shown.n_updates += 1;
            }
            _ => panic!("a packet of kind {kind}"),
        }
        assert!(fields.0.is_empty(), "bytes are left");
    }
    shown
}

#[test]
fn the_viewer_ends_with_the_picture() {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let view = UnfoldedView::new(&solved.scene, 20.try_into().unwrap()).unwrap();
    let (width, height) = view.size();
    let rounds = GatherSettings {
        noise: 0.01,
        max_rays: 1024.try_into().unwrap(),
    };
    for gather in [None, Some(rounds)] {
        let settings = RenderSettings {
            direct: DirectMethod::Exact,
            gather,
            ..RenderSettings::default()
        };
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let server = std::thread::spawn(move || serve(listener.accept().unwrap().0));
        let display = TevDisplay::connect(&address, "cube.exr", width, height).unwrap();
        let image = render_watched(&solved.input(&visibility), &view, &settings, &Silent, &display).unwrap();
        assert!(display.is_connected());
        drop(display);
        let shown = server.join().unwrap();
        assert_eq!((shown.name.as_str(), shown.width, shown.height), ("cube.exr", 80, 60));
        // 3 × 2 blocks of 32 pixels a side; again for every round.
        let n = shown.n_updates;
        assert!(if gather.is_some() { n > 12 } else { n == 6 }, "{n}");
        let layers = ["R", "G", "B"].map(|name| image.f32(name).unwrap());
        for (k, pixel) in shown.pixels.iter().enumerate() {
            assert_eq!(pixel.map(f32::to_bits), layers.map(|layer| layer[k].to_bits()), "{k}");
        }
    }
}

/// The same calls, the same bytes as from the viewer's own Python client: tevclient 1.0.4, `packet.create_image("a.exr", 2, 1, ["R", "G", "B"], True)` and
/// `packet.update_image("a.exr", [[[1, 2, 3], [4, 5, 6.5]]], ["R", "G", "B"], 3, 1, False)`.
#[test]
fn the_packets_are_those_of_the_viewers_own_client() {
    let create = b"\x1e\0\0\0\x04\x01a.exr\0\x02\0\0\0\x01\0\0\0\x03\0\0\0R\0G\0B\0";
    let update = b"n\0\0\0\x06\0a.exr\0\x03\0\0\0R\0G\0B\0\x03\0\0\0\x01\0\0\0\x02\0\0\0\x01\0\0\0\
        \0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\x02\0\0\0\0\0\0\0\
        \x03\0\0\0\0\0\0\0\x03\0\0\0\0\0\0\0\x03\0\0\0\0\0\0\0\
        \0\0\x80?\0\0\0@\0\0@@\0\0\x80@\0\0\xa0@\0\0\xd0@";
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        listener.accept().unwrap().0.read_to_end(&mut bytes).unwrap();
        bytes
    });
    let display = TevDisplay::connect(&address, "a.exr", 2, 1).unwrap();
    display.pixels(3, 1, 2, 1, &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.5]]);
    drop(display);
    assert_eq!(server.join().unwrap(), [&create[..], &update[..]].concat());
}

#[test]
fn nothing_listening_is_an_error_and_a_viewer_that_leaves_is_none() {
    let solved = Solved::new(bright_cube(), 1);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let view = UnfoldedView::new(&solved.scene, 200.try_into().unwrap()).unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let display = TevDisplay::connect(&address, "cube.exr", 800, 600).unwrap();
    drop(listener.accept().unwrap());
    drop(listener);
    let settings = RenderSettings::default();
    let image = render_watched(&solved.input(&visibility), &view, &settings, &Silent, &display).unwrap();
    assert!(image.f32("R").unwrap().iter().any(|&l| l > 0.0));
    assert!(!display.is_connected());
    assert!(TevDisplay::connect(&address, "cube.exr", 8, 8).is_err());
}
