//! Sparsity, space, fields and labels; every file is well-formed.

use super::*;

/// A mass, whose spring force is an algebraic state.
#[dae]
fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, p: f64) -> [f64; 3] {
    [xdot[0] - x[1], xdot[1] + z, z - p * x[0].sinh()]
}

#[test]
fn sparsity_plots() -> Test {
    let structure = Spring::describe();
    let figure =
        Figure::new().with(Sparsity::jacobian(structure)).column(1.0).with(Sparsity::factors(structure));
    let svg = figure.to_svg();
    let document = Document::parse(&svg)?;
    let of = |title: &str, colour: Colour| {
        let group = groups(&document, "sparsity", None).into_iter().find(|group| {
            group.descendants().any(|node| node.text().is_some_and(|text| text.starts_with(title)))
        });
        let squares = group.into_iter().flat_map(|group| group.descendants());
        // One of them stands in the legend.
        squares.filter(|node| node.attribute("fill") == Some(&colour.to_string())).count() - 1
    };
    // ẋ₀, ẋ₁, x₁, z twice; p, whose second derivative vanishes; x₀, whose does not.
    assert_eq!(of("Spring: Jacobian, 7", Colour(150, 170, 195)), 5);
    assert_eq!(of("Spring: Jacobian, 7", Colour::BLUE), 1);
    assert_eq!(of("Spring: Jacobian, 7", Colour::RED), 1);
    // The position is kinematic: two unknowns are left, of which each depends on the other.
    assert_eq!(of("Spring: factors", Colour::GREEN) + of("Spring: factors", Colour::INK), 2);
    assert_eq!((of("Spring: factors", Colour::BLUE), of("Spring: factors", Colour::ORANGE)), (2, 0));
    Ok(())
}

#[test]
fn viewpoint_of_3d_plots() -> Test {
    // A screw around the third axis: from above a circle, from the side as high as it is.
    let turns = (0..=200).map(|i| f64::from(i) * std::f64::consts::PI / 50.0);
    let screw: Vec<[f64; 3]> = turns.map(|t| [2.0 * t.cos(), 2.0 * t.sin(), 0.5 * t]).collect();
    let seen = |azimuth, elevation| -> Result<Vec<[f64; 2]>, Box<dyn std::error::Error>> {
        let space = Space::new("A screw").seen_from(azimuth, elevation).line("screw", screw.iter().copied());
        let svg = Figure::new().size(900, 900).with(space).to_svg();
        let document = Document::parse(&svg)?;
        pixels(&lines(&groups(&document, "series", Some("screw"))[0])[0])
    };
    let extent = |points: &[[f64; 2]], i: usize| {
        let values = || points.iter().map(|point| point[i]);
        [values().fold(f64::MAX, f64::min), values().fold(f64::MIN, f64::max)]
    };
    let above = seen(-90.0, 90.0)?;
    let centre = [0, 1].map(|i| extent(&above, i).iter().sum::<f64>() / 2.0);
    let radius = above[0][0] - centre[0];
    assert!(radius > 50.0, "the first axis points to the right");
    for point in &above {
        assert!(((point[0] - centre[0]).hypot(point[1] - centre[1]) - radius).abs() < 0.3);
    }
    // A quarter of a turn later it is at the end of the second axis, which points upwards.
    assert!((above[25][1] - (centre[1] - radius)).abs() < PIXEL);
    let side = seen(-90.0, 0.0)?;
    let [[left, right], [top, bottom]] = [0, 1].map(|i| extent(&side, i));
    assert!(((bottom - top) / (right - left) - std::f64::consts::TAU / 4.0).abs() < 0.01);
    assert!((side[0][1] - bottom).abs() < PIXEL, "the third axis points upwards");
    Ok(())
}

#[test]
fn lines_of_varying_colour() -> Test {
    let points = (0..=50).map(|i| f64::from(i) / 50.0).map(|t| (t, t * t, (6.0 * t).sin()));
    let svg = Figure::new().with(Panel::new("").coloured("power", points)).to_svg();
    let document = Document::parse(&svg)?;
    let series = groups(&document, "series", Some("power"))[0];
    let pieces = lines(&series).iter().map(pixels).collect::<Result<Vec<_>, _>>()?;
    assert!(pieces.len() > 20);
    for pair in pieces.windows(2) {
        assert_eq!(pair[0].last(), pair[1].first());
    }
    let colours: std::collections::BTreeSet<_> =
        lines(&series).iter().filter_map(|line| line.attribute("stroke").map(String::from)).collect();
    assert!(
        colours.contains(&Colour::mix(0.0).to_string()) && colours.contains(&Colour::mix(1.0).to_string())
    );
    Ok(())
}

#[test]
fn direction_fields() -> Test {
    let rotation = |x: [f64; 2]| [-x[1], x[0]];
    let panel = Panel::new("").field(rotation).x_range(-1.0..1.0).y_range(-1.0..1.0).equal().line("", []);
    let svg = Figure::new().with(panel).to_svg();
    let document = Document::parse(&svg)?;
    let panel = groups(&document, "panel", None)[0];
    let [of_x, of_y] = axes(&panel)?;
    let field = groups(&document, "field", None)[0];
    let path = field.children().find_map(|node| node.attribute("d")).ok_or("no strokes")?;
    let strokes: Vec<&str> = path.split('M').skip(1).collect();
    assert!(strokes.len() > 100);
    for stroke in strokes {
        let numbers = stroke.split(['L', ',']).map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let [x, y, tip_x, tip_y] = numbers[..] else { return Err(stroke.into()) };
        let ([x, tip_x], [y, tip_y]) = ([x, tip_x].map(|p| of_x.value(p)), [y, tip_y].map(|p| of_y.value(p)));
        let (dx, dy) = (tip_x - x, tip_y - y);
        let cosine = (dx * -y + dy * x) / (dx.hypot(dy) * x.hypot(y));
        assert!(cosine > 0.99, "{stroke:?}");
    }
    Ok(())
}

#[test]
fn labels_of_points() -> Test {
    let names = ["one", "two", "three"];
    let panel = Panel::new("").x_names(names).dots("dots", [(0.0, 1.0), (1.0, 2.0), (2.0, 4.0)]);
    let svg = Figure::new().with(panel).to_svg();
    let document = Document::parse(&svg)?;
    let dots = groups(&document, "series", Some("dots"))[0];
    let dots: Vec<_> = dots.descendants().filter_map(|node| node.attribute("cx")).collect();
    for (name, dot) in names.into_iter().zip(dots) {
        let text = document.descendants().find(|node| node.text() == Some(name) && node.has_tag_name("text"));
        assert_eq!(text.and_then(|text| text.attribute("x")), Some(dot), "{name}");
    }
    Ok(())
}

#[test]
fn alignment_of_axes() -> Test {
    let [short, long] = [1.0, 1e4].map(|size| Panel::new("").y("unit").line("", [(0.0, 0.0), (1.0, size)]));
    let svg = Figure::new().with(short).with(long).to_svg();
    let document = Document::parse(&svg)?;
    let frames = groups(&document, "axes", None).into_iter().filter_map(|group| {
        group.children().find(|node| node.has_tag_name("rect")).and_then(|frame| frame.attribute("x"))
    });
    let frames: Vec<_> = frames.collect();
    assert!(frames.len() == 2 && frames[0] == frames[1], "{frames:?}");
    Ok(())
}

#[test]
fn well_formed_files() -> Test {
    let hostile = "a < b & \"c\" > d \0 \u{1b}[31m \u{b} \u{ffff} \t \r\n";
    // From the least denormal number to the largest, and what a logarithmic axis has no place for.
    let extreme = [5e-324, 1e-310, 1e300, f64::MAX, 0.0, -0.0, -1.0, f64::MIN, -5e-324, f64::NAN];
    let pairs = || extreme.into_iter().flat_map(|x| extreme.map(|y| (x, y)));
    let wide = || Panel::new("").line("line", pairs()).dots("dots", pairs()).text((0.0, -1.0), "none");
    let denormal = || Panel::new("").line("", [(5e-324, 1e-320), (1e-322, 1e-310)]);
    let large = || Panel::new("").line("", [(1e299, 1e300), (1e308, f64::MAX)]).limit(1e-300).limit(0.0);
    let axes: [fn(Panel) -> Panel; 6] = [
        |panel| panel,
        Panel::log_x,
        |panel| panel.log_x().log_y(),
        |panel| panel.log_y().equal(),
        |panel| panel.log_x().x_range(-1.0..1e300).y_range(0.0..5e-324),
        |panel| panel.log_y().y_range(1e-320..1e308).x_range(f64::MIN..f64::MAX),
    ];
    let panels = axes.into_iter().flat_map(|axes| [wide(), denormal(), large()].map(axes));
    let extremes = Figure::new().with_all(panels);
    let strange =
        [(0.0, f64::NAN), (f64::INFINITY, 1.0), (1.0, -f64::INFINITY), (2.0, f64::MAX), (3.0, f64::MIN)];
    let figures = [
        Figure::new(),
        Figure::new().column(f64::NAN),
        Figure::new().size(0, 0).with(Panel::new(hostile)),
        Figure::new()
            .with(Panel::new(hostile).x(hostile).y(hostile).line(hostile, strange).text((0.0, 0.0), hostile)),
        Figure::new().with(Panel::default().log_x().log_y().dots("", strange).limit(-1.0)),
        Figure::new().with(Panel::default().x_range(1.0..1.0).y_range(f64::NAN..0.0).steps("", strange)),
        Figure::new().with(Panel::histogram([(hostile, &[0.0, f64::NAN, -1.0][..]), ("", &[])])),
        Figure::new()
            .with(Space::new(hostile).seen_from(f64::NAN, 400.0).line(hostile, [[f64::NAN, 0.0, 1.0]])),
        Figure::new().with(Space::new("").coloured("", [([1.0; 3], f64::NAN)])),
        Figure::new().with(Panel::new("").motion([vec![(0.0, 1.0)], vec![]]).outline([])),
        Figure::new().with(Panel::new("").with(Curve::line("", strange).width(f64::NAN))),
        extremes,
    ];
    for figure in figures {
        let svg = figure.to_svg();
        let document = Document::parse(&svg)?;
        // Parsers are lenient: what XML 1.0 calls a character, of what is drawn here.
        let is_character = |c: char| "\t\n\r".contains(c) || (c >= ' ' && c != '\u{ffff}');
        assert!(svg.chars().all(is_character));
        assert_eq!(document.root_element().tag_name().name(), "svg");
        let numbers =
            ["x", "y", "width", "height", "cx", "cy", "r", "points", "stroke-width", "d", "transform"];
        let attributes = document.descendants().flat_map(|node| node.attributes());
        for attribute in attributes.filter(|attribute| numbers.contains(&attribute.name())) {
            let value = attribute.value().trim_start_matches("rotate").replace('%', "");
            // Programs read attributes in single precision.
            let is_short =
                |text: &str| text.is_empty() || text.parse::<f64>().is_ok_and(|number| number.abs() < 1e7);
            assert!(value.split([' ', ',', 'M', 'L', '(', ')']).all(is_short), "{attribute:?}");
        }
    }
    Ok(())
}

#[test]
fn styles_of_series() -> Test {
    let series = Curve::line("limit", [(0.0, 0.0), (1.0, 1.0)]).colour(Colour::RED).width(1.0).dashed();
    let folder = std::env::temp_dir().join(format!("casados_plot_{}", std::process::id()));
    let path = folder.join("inside/figure.svg");
    Figure::new().with(Panel::new("").with(series).dots("dots", [(0.5, 0.5)])).save(&path)?;
    let svg = std::fs::read_to_string(&path)?;
    std::fs::remove_dir_all(&folder)?;
    let document = Document::parse(&svg)?;
    let line = lines(&groups(&document, "series", Some("limit"))[0])[0];
    assert_eq!(line.attribute("stroke"), Some("#c83e2d"));
    assert_eq!(
        (line.attribute("stroke-width"), line.attribute("stroke-dasharray")),
        (Some("1"), Some("5 4"))
    );
    let dots = groups(&document, "series", Some("dots"))[0];
    assert_eq!(dots.descendants().filter(|node| node.tag_name().name() == "circle").count(), 1);
    let error = Figure::new().save(std::env::temp_dir()).unwrap_err();
    assert!(error.to_string().starts_with("cannot write"), "{error}");
    Ok(())
}
