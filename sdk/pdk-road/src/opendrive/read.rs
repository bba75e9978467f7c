//! Maps from OpenDRIVE.

use roxmltree::{Document, Node};

use super::geometry::{Piece, Shape};
use super::map::{Connection, Cubic, LaneRecord, Map, Neighbour, Road, Section};

impl Map {
    /// Reads a map.
    ///
    /// # Errors
    /// If the text is not OpenDRIVE, with the road where it is not.
    pub fn read(text: &str) -> Result<Self, String> {
        let document = Document::parse(text).map_err(|error| format!("the map is not XML: {error}"))?;
        let root = document.root_element();
        if root.tag_name().name() != "OpenDRIVE" {
            return Err(format!("the map is not OpenDRIVE: it begins with `{}`", root.tag_name().name()));
        }
        let mut map = Self::default();
        for node in children(root, "road") {
            let id = node.attribute("id").unwrap_or_default();
            let road = road(node).map_err(|error| format!("road `{id}` of the map: {error}"))?;
            map.roads.insert(id.to_owned(), road);
        }
        for junction in children(root, "junction") {
            for node in children(junction, "connection") {
                let text = |name| node.attribute(name).unwrap_or_default().to_owned();
                let links =
                    children(node, "laneLink").map(|link| Ok((whole(link, "from")?, whole(link, "to")?)));
                let connection = Connection {
                    junction: junction.attribute("id").unwrap_or_default().to_owned(),
                    incoming: text("incomingRoad"),
                    connecting: text("connectingRoad"),
                    contact: contact(node),
                    links: links
                        .collect::<Result<_, String>>()
                        .map_err(|error| format!("a junction of the map: {error}"))?,
                };
                map.connections.push(connection);
            }
        }
        if map.roads.is_empty() {
            return Err("the map has no roads".to_owned());
        }
        Ok(map)
    }
}

fn children<'a>(node: Node<'a, 'a>, name: &'static str) -> impl Iterator<Item = Node<'a, 'a>> {
    node.children().filter(move |child| child.has_tag_name(name))
}

fn child<'a>(node: Node<'a, 'a>, name: &'static str) -> Option<Node<'a, 'a>> {
    children(node, name).next()
}

fn number(node: Node<'_, '_>, name: &str) -> Result<f64, String> {
    let text = node.attribute(name).unwrap_or_default();
    text.trim().parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(|| {
        format!("`{name}` of `{}` is `{text}`, but has to be a number", node.tag_name().name())
    })
}

fn whole(node: Node<'_, '_>, name: &str) -> Result<i32, String> {
    let text = node.attribute(name).unwrap_or_default();
    text.trim().parse().map_err(|_| {
        format!("`{name}` of `{}` is `{text}`, but has to be a whole number", node.tag_name().name())
    })
}

/// At which end of a road one enters it: 0 for its beginning.
fn contact(node: Node<'_, '_>) -> usize {
    usize::from(node.attribute("contactPoint") == Some("end"))
}

fn cubics<'a>(nodes: impl Iterator<Item = Node<'a, 'a>>, from: &str) -> Result<Vec<Cubic>, String> {
    nodes
        .map(|node| {
            let coefficient = |name| number(node, name);
            let coefficients = [coefficient("a")?, coefficient("b")?, coefficient("c")?, coefficient("d")?];
            Ok(Cubic { from: number(node, from)?, coefficients })
        })
        .collect()
}

fn road(node: Node<'_, '_>) -> Result<Road, String> {
    let mut road = Road {
        length: number(node, "length")?,
        left_hand_traffic: node.attribute("rule") == Some("LHT"),
        ..Road::default()
    };
    if !(0.0..1e6).contains(&road.length) {
        return Err(format!("it is {} m long", road.length));
    }
    if let Some(link) = child(node, "link") {
        road.neighbours = [neighbour(child(link, "predecessor")), neighbour(child(link, "successor"))];
    }
    let plan = child(node, "planView").ok_or("it has no `planView`")?;
    road.plan = children(plan, "geometry").map(piece).collect::<Result<_, String>>()?;
    if road.plan.is_empty() {
        return Err("its `planView` has no `geometry`".to_owned());
    }
    road.plan.sort_by(|a, b| a.s.total_cmp(&b.s));
    if let Some(profile) = child(node, "elevationProfile") {
        road.heights = cubics(children(profile, "elevation"), "s")?;
    }
    let Some(lanes) = child(node, "lanes") else { return Ok(road) };
    road.offsets = cubics(children(lanes, "laneOffset"), "s")?;
    for section in children(lanes, "laneSection") {
        let mut read = Section { from: number(section, "s")?, ..Section::default() };
        for side in section.children().filter(Node::is_element) {
            for lane in children(side, "lane") {
                let link = |name| match child(lane, "link").and_then(|link| child(link, name)) {
                    Some(link) => whole(link, "id").map(Some),
                    None => Ok(None),
                };
                let record = LaneRecord {
                    driving: matches!(lane.attribute("type"), Some("driving" | "bidirectional")),
                    widths: cubics(children(lane, "width"), "sOffset")?,
                    links: [link("predecessor")?, link("successor")?],
                };
                read.lanes.insert(whole(lane, "id")?, record);
            }
        }
        road.sections.push(read);
    }
    road.sections.sort_by(|a, b| a.from.total_cmp(&b.from));
    Ok(road)
}

fn neighbour(node: Option<Node<'_, '_>>) -> Option<Neighbour> {
    let node = node?;
    let id = node.attribute("elementId")?.to_owned();
    match node.attribute("elementType") {
        Some("junction") => Some(Neighbour::Junction(id)),
        _ => Some(Neighbour::Road(id, contact(node))),
    }
}

fn piece(node: Node<'_, '_>) -> Result<Piece, String> {
    let shape = node.children().find(Node::is_element).ok_or("a `geometry` says no shape")?;
    let four = |names: [&str; 4]| -> Result<[f64; 4], String> {
        let mut values = [0.0; 4];
        for (value, name) in values.iter_mut().zip(names) {
            *value = number(shape, name)?;
        }
        Ok(values)
    };
    let length = number(node, "length")?;
    let shape = match shape.tag_name().name() {
        "line" => Shape::Arc(0.0),
        "arc" => Shape::Arc(number(shape, "curvature")?),
        "spiral" => Shape::Spiral(number(shape, "curvStart")?, number(shape, "curvEnd")?),
        "poly3" => Shape::Cubic(four(["a", "b", "c", "d"])?),
        "paramPoly3" => {
            let range = if shape.attribute("pRange") == Some("arcLength") { length } else { 1.0 };
            Shape::Parametric(four(["aU", "bU", "cU", "dU"])?, four(["aV", "bV", "cV", "dV"])?, range)
        }
        other => return Err(format!("a `geometry` has the unknown shape `{other}`")),
    };
    if !(0.0..1e6).contains(&length) {
        return Err(format!("a `geometry` is {length} m long"));
    }
    Ok(Piece {
        s: number(node, "s")?,
        at: [number(node, "x")?, number(node, "y")?],
        heading: number(node, "hdg")?,
        length,
        shape,
    })
}
