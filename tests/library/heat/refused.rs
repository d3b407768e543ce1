//! Boundary files: accepted ones, and refused ones with their line and a remedy.

use radiosity::heat::{Boundary, Condition};

use super::{boundary, heat, inside, rectangle, scene, try_heat};

/// An exact name counts before a pattern; later entries replace single keys of earlier ones.
#[test]
fn entries_replace_keys() {
    let room = scene(&inside([1.0; 3]));
    let text = "[[surface]]\nname = \"x0\"\nemissivity = 0.9\n[[surface]]\nname = \"*\"\nemissivity = 0.1\nabsorptance = 0.2\ntemperature_k = 300\n\
         [[surface]]\nname = \"z*\"\nadiabatic = true\nemissivity = 0.3\n[[surface]]\nname = \"z1\"\nabsorptance = 0.7\n[[surface]]\nname = \"*0\"\nabsorptance = 0.25\n";
    let found = boundary(text, &room).unwrap();
    let of = |name: &str| {
        let k = room.surfaces.iter().position(|surface| surface.name == name).unwrap();
        let own = found.surfaces[k].unwrap();
        (own.emissivity, own.absorptance, own.condition)
    };
    assert_eq!(of("x0"), (0.9, 0.25, Condition::Temperature(300.0)));
    assert_eq!(of("x1"), (0.1, 0.2, Condition::Temperature(300.0)));
    assert_eq!(of("z0"), (0.3, 0.25, Condition::Supplied(0.0)));
    assert_eq!(of("z1"), (0.3, 0.7, Condition::Supplied(0.0)));
}

/// Files with the line of their mistake, and words of the message.
const MISTAKES: &[(&str, u32, &str)] = &[
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0\ntemperature_k = 1\n",
        3,
        "emissivity: 0.0 is outside (0, 1]",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 1.1\ntemperature_k = 1\n",
        3,
        "outside (0, 1]",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = nan\ntemperature_k = 1\n",
        3,
        "outside (0, 1]",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 1e-15\nadiabatic = true\n[[surface]]\nname = \"x0\"\ntemperature_k = 1\n",
        3,
        "surface `x0`: emissivity: 1e-15 is below 1e-10",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = [0.5, 1e-17]\ntemperature_k = 1\n",
        3,
        "emissivity: 1e-17 is below 1e-10",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0.5\nabsorptance = -0.1\ntemperature_k = 1\n",
        4,
        "outside [0, 1]",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0.5\ntemperature_k = -1\n",
        4,
        "is negative; give kelvin",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0.5\nsupplied_w_m2 = inf\n",
        4,
        "supplied_w_m2",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0.5\ntemperature_k = 1\nadiabatic = true\n",
        2,
        "2 conditions in one entry",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0.5\nadiabatic = false\n",
        4,
        "is no condition",
    ),
    ("[[surface]]\nname = \"*\"\nemissivity = 0.5\n", 2, "has no condition"),
    (
        "[[surface]]\nname = \"*\"\ntemperature_k = 1\n",
        2,
        "has no `emissivity`",
    ),
    ("[[surface]]\nname = \"q\"\nemissivity = 0.5\n", 2, "matches no surface"),
    (
        "[[surface]]\nname = \"q*\"\nemissivity = 0.5\n",
        2,
        "matches no surface",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0.5\nnode = \"n\"\n",
        4,
        "add one",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0.5\nother_side = \"q\"\n",
        4,
        "matches nothing",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0.5\nother_side = \"x0\"\n",
        4,
        "other side",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = 0.5\nkelvin = 5\n",
        4,
        "unknown field",
    ),
    ("[surroundings]\ntemperature_k = -3\n", 2, "surroundings.temperature_k"),
    (
        "[sun]\ndirection = [0, 0, 0]\nirradiance_w_m2 = 1\n",
        2,
        "sun.direction: zero",
    ),
    (
        "[sun]\ndirection = [0, 0, 1]\nirradiance_w_m2 = -1\n",
        3,
        "sun.irradiance_w_m2",
    ),
    ("[sky]\nirradiance_w_m2 = 1\nup = [0, 0]\n", 3, "three numbers"),
    (
        "[surface]\nname = \"*\"\nemissivity = 0.5\n",
        1,
        "in two brackets, as in [[name]]",
    ),
    (
        "[sun]\ndirection = [0, 0, 1]\nirradiance_w_m2 = [1, 2, 3]\n",
        3,
        "invalid type: list, expected a number",
    ),
    (
        "[[surface]]\nname = \"*\"\nemissivity = []\ntemperature_k = 1\n",
        3,
        "expected a number, or a list of one for each patch",
    ),
];

#[test]
fn mistakes_are_told_with_their_line() {
    let room = scene(&inside([1.0; 3]));
    let all = "[[surface]]\nname = \"*\"\nemissivity = 0.5\ntemperature_k = 300.0\n";
    for &(text, line, words) in MISTAKES {
        let error = boundary(text, &room).unwrap_err();
        let message = error.to_string();
        assert!(
            error.line() == Some(line) && message.contains(words) && !message.contains('\n'),
            "{text}: {message}"
        );
        assert_eq!(error.kind(), "bad_boundary");
    }
    assert!(boundary(&all.replace("0.5", "1e-10"), &room).is_ok());
    let unused = format!("{all}[[node]]\nname = \"n\"\n");
    let message = boundary(&unused, &room).unwrap_err().to_string();
    assert!(message.contains("no surface has it"), "{message}");
    let twice =
        format!("{all}[[surface]]\nname = \"x0\"\nnode = \"n\"\n[[node]]\nname = \"n\"\n[[node]]\nname = \"n\"\n");
    assert!(boundary(&twice, &room).unwrap_err().to_string().contains("two nodes"));
    let half = format!(
        "{all}[[surface]]\nname = \"x0\"\nother_side = \"x1\"\n[[surface]]\nname = \"x1\"\ntemperature_k = 5\n"
    );
    assert!(
        boundary(&half, &room)
            .unwrap_err()
            .to_string()
            .contains("has another condition")
    );
    let nothing = boundary("[surroundings]\ntemperature_k = 3\n", &room).unwrap_err();
    assert!(nothing.to_string().contains("no `surface` entry; add one"), "{nothing}");
}

/// Entries of a program have no lines: what is wrong in one, or between them, names the entry.
#[test]
fn mistakes_in_parts_are_told_with_their_name() {
    let room = scene(&inside([1.0; 3]));
    let all = "[[surface]]\nname = \"*\"\nemissivity = 0.5\ntemperature_k = 300.0\n";
    let told = |second: &str| {
        let parts = [
            ("first", all),
            ("second", second),
            ("third", "[surroundings]\ntemperature_k = 3.0\n"),
        ];
        let parts = parts.map(|(name, text)| (name.into(), text.to_owned()));
        let error = Boundary::parse_parts(parts, "whole", &room).unwrap_err();
        assert_eq!(error.line(), None);
        error.to_string()
    };
    for (second, message) in [
        (
            "[[surface]]\nname = \"x0\"\nemissivity = 2.0\n",
            "second: surface `x0`: emissivity: 2.0 is outside (0, 1]; correct it",
        ),
        (
            "[[surface]]\nname = \"x0\"\nnode = \"n\"\n",
            "second: `node` `n` matches nothing; there is no [[node]]; add one",
        ),
    ] {
        assert_eq!(told(second), message);
    }
    assert!(told("[[surface]]\nname = \"x0\"\nemisivity = 2.0\n").starts_with("second: unknown field `emisivity`"));
}

/// A closed room without a temperature: none, or infinitely many solutions; with one, or a node beside one, it is solved.
#[test]
fn rooms_without_a_temperature_are_refused() {
    let room = scene(&inside([1.0; 3]));
    let all = "[[surface]]\nname = \"*\"\nemissivity = 0.5\nadiabatic = true\n";
    let message = |more: &str| {
        let found = try_heat(&room, 1, &format!("{all}{more}"));
        found.err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert!(message("").contains("infinitely many"), "{}", message(""));
    let supplied = message("[[surface]]\nname = \"x0\"\nsupplied_w_m2 = 2.5\n");
    assert!(
        supplied.contains("2.500e0 W") && supplied.contains("no temperature solves"),
        "{supplied}"
    );
    let balanced =
        message("[[surface]]\nname = \"x0\"\nsupplied_w_m2 = 2.5\n[[surface]]\nname = \"x1\"\nsupplied_w_m2 = -2.5\n");
    assert!(balanced.contains("infinitely many"), "{balanced}");
    let node = message("[[surface]]\nname = \"x0\"\nnode = \"n\"\n[[node]]\nname = \"n\"\nsupplied_w = -1\n");
    assert!(node.contains("-1.000e0 W"), "{node}");
    heat(
        &room,
        1,
        &format!("{all}[[surface]]\nname = \"x0\"\ntemperature_k = 0\n"),
    );
    // A plate that heat is taken from, more than it absorbs.
    let cold =
        message("[[surface]]\nname = \"x0\"\nsupplied_w_m2 = -1e6\n[[surface]]\nname = \"x1\"\ntemperature_k = 300\n");
    assert!(
        cold.contains("`x0` has no temperature") && cold.contains("1.000e6"),
        "{cold}"
    );
    assert!(cold.contains("boundary.toml:7: "), "{cold}");
}

/// Rooms side by side: the one without a temperature is refused, unless a node ties it to the other.
#[test]
fn nodes_tie_rooms() {
    let mut both = inside([1.0; 3]);
    let names: Vec<String> = both.iter().map(|(name, _)| format!("far {name}")).collect();
    let far: Vec<_> = both
        .iter()
        .map(|(_, faces)| {
            let moved = |face: &Vec<glam::DVec3>| face.iter().map(|v| *v + 5.0).collect();
            faces.iter().map(moved).collect::<Vec<Vec<_>>>()
        })
        .collect();
    both.extend(names.iter().map(String::as_str).zip(far));
    let both = scene(&both);
    let text = "[[surface]]\nname = \"*\"\nemissivity = 0.5\nadiabatic = true\n[[surface]]\nname = \"x0\"\ntemperature_k = 300\n";
    let alone = try_heat(&both, 1, text)
        .err()
        .map(|error| error.to_string())
        .unwrap_or_default();
    assert!(alone.contains("`far x0`"), "{alone}");
    let tied = format!("{text}[[surface]]\nname = \"*y1\"\nnode = \"n\"\n[[node]]\nname = \"n\"\n");
    let found = heat(&both, 1, &tied);
    for surface in &found.study.heat.surfaces {
        assert!((surface.temperature_k - 300.0).abs() < 1e-6, "{surface:?}");
    }
}

#[test]
fn sides_that_do_not_coincide_are_refused() {
    let plates = scene(&[
        ("a", vec![rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])]),
        ("b", vec![rectangle([0.0, 0.0, 0.1], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])]),
    ]);
    let text = "[[surface]]\nname = \"*\"\nemissivity = 0.5\n[[surface]]\nname = \"a\"\nother_side = \"b\"\n";
    let error = try_heat(&plates, 2, text)
        .err()
        .map(|error| error.to_string())
        .unwrap_or_default();
    assert!(
        error.contains("two sides of one sheet") && error.contains("4 patches"),
        "{error}"
    );
    assert!(error.contains("boundary.toml:6: "), "{error}");
}
