//! The structural index: a matching of equations to unknowns `(ẋ, z)`.

use crate::graph::Entry;
use crate::language::Model;

/// The wording of errors about equations and unknowns without a matching.
pub struct MatchingErrorText<'a> {
    /// The name of an unknown.
    pub name: &'a dyn Fn(usize) -> String,
    /// What an equation without unknowns lacks.
    pub nothing: &'a str,
    /// The conclusion, and the remedy.
    pub conclusion: &'a str,
}

/// Returns an error if no matching of equations to unknowns exists in the pattern of `(f_ẋ, f_z)`:
/// then `∂f/∂(ẋ, z)` is singular for all values, and the index of the model is not 1.
pub fn check(model: &Model, jacobian: &[Entry], ends: [u32; 5]) -> syn::Result<()> {
    let nx = ends[0];
    let mut rows = vec![Vec::new(); model.residual.len()];
    for &(row, variable, _) in jacobian {
        if variable < nx {
            rows[row as usize].push(variable as usize);
        } else if (ends[1]..ends[2]).contains(&variable) {
            rows[row as usize].push((variable - ends[1] + nx) as usize);
        }
    }
    let name = |unknown: usize| match model.variables.x.get(unknown) {
        Some(name) => derivative_name(name),
        None => format!("`{}`", model.variables.z[unknown - nx as usize]),
    };
    let way_out = match model.reduction {
        None => ", or let `#[dae(index_reduction)]` do so",
        Some(_) => "",
    };
    let conclusion = format!(
        "the model is not of index 1: differentiate these equations with respect to time{way_out}; otherwise remove the \
         undetermined unknowns"
    );
    let nothing = "neither a derivative nor an algebraic state";
    matching(model, &rows, &MatchingErrorText { name: &name, nothing, conclusion: &conclusion })
}

/// Returns an error if no matching of equations to unknowns exists in the pattern `rows`. It names
/// the over- and underdetermined parts (the Dulmage-Mendelsohn decomposition).
pub fn matching(model: &Model, rows: &[Vec<usize>], words: &MatchingErrorText) -> syn::Result<()> {
    let count = rows.len();
    let matching = maximum_matching(rows, count);
    if matching.iter().all(Option::is_some) {
        return Ok(());
    }
    let mut columns = vec![Vec::new(); count];
    for (row, pattern) in rows.iter().enumerate() {
        pattern.iter().for_each(|&column| columns[column].push(row));
    }
    // From each unmatched equation along alternating paths: too many equations for these unknowns.
    // From each unmatched unknown: too few equations for these unknowns.
    let of_row = inverse(&matching, count);
    let parts = [
        components(rows, &matching, &unmatched(&of_row)),
        components(&columns, &of_row, &unmatched(&matching)),
    ];
    let name = |&unknown: &usize| (words.name)(unknown);
    let number = |equation: &usize| equation.to_string();
    let mut sentences = Vec::new();
    for (equations, unknowns) in &parts[0] {
        let subject = count_phrase("equation", "equations", equations, number);
        let s = if equations.len() == 1 { "s" } else { "" };
        sentences.push(if unknowns.is_empty() {
            format!("{subject} contain{s} {}", words.nothing)
        } else {
            format!("{subject} determine{s} only {}", listed_names(unknowns, name))
        });
    }
    for (unknowns, equations) in &parts[1] {
        let verb = if unknowns.len() == 1 { "is" } else { "are" };
        let object = match equations.len() {
            0 => "by no equation".into(),
            1 => format!("only by equation {}", equations[0]),
            _ => format!("only by equations {}", listed_names(equations, number)),
        };
        sentences.push(format!("{} {verb} determined {object}", listed_names(unknowns, name)));
    }
    let message = format!("{}: {} (equations are counted from 0)", sentences.join("; "), words.conclusion);
    // At every affected equation; several from the same tokens count as one.
    let concerned = |part: usize| parts[part].iter().flat_map(move |(a, b)| if part == 0 { a } else { b });
    let mut seen = Vec::new();
    let mut error: Option<syn::Error> = None;
    for &equation in concerned(0).chain(concerned(1)) {
        let span = model.spans.get(equation).copied().unwrap_or_else(|| model.name.span());
        let place = format!("{span:?}");
        match &mut error {
            None => error = Some(syn::Error::new(span, &message)),
            Some(error) if !seen.contains(&place) => {
                error.combine(syn::Error::new(span, format!("equation {equation} is one of these")));
            }
            Some(_) => {}
        }
        seen.push(place);
    }
    Err(error.unwrap_or_else(|| syn::Error::new(model.name.span(), &message)))
}

/// For each column the row matched with it: a maximum matching, by augmenting paths.
fn maximum_matching(rows: &[Vec<usize>], columns: usize) -> Vec<Option<usize>> {
    let mut matching: Vec<Option<usize>> = vec![None; columns];
    for start in 0..rows.len() {
        // Breadth first; each column stores the row from which it was reached.
        let mut from: Vec<Option<usize>> = vec![None; columns];
        let mut of_row: Vec<Option<usize>> = vec![None; rows.len()];
        let mut queue = std::collections::VecDeque::from([start]);
        'search: while let Some(row) = queue.pop_front() {
            for &column in &rows[row] {
                if from[column].is_some() {
                    continue;
                }
                from[column] = Some(row);
                match matching[column] {
                    Some(next) => {
                        of_row[next] = Some(column);
                        queue.push_back(next);
                    }
                    None => {
                        // Exchange along the path.
                        let mut free = Some(column);
                        while let Some(column) = free {
                            let row = from[column];
                            matching[column] = row;
                            free = row.filter(|&row| row != start).and_then(|row| of_row[row]);
                        }
                        break 'search;
                    }
                }
            }
        }
    }
    matching
}

/// The inverse of a partial map.
fn inverse(map: &[Option<usize>], len: usize) -> Vec<Option<usize>> {
    let mut inverse = vec![None; len];
    for (from, to) in map.iter().enumerate() {
        if let Some(to) = *to {
            inverse[to] = Some(from);
        }
    }
    inverse
}

fn unmatched(map: &[Option<usize>]) -> Vec<usize> {
    (0..map.len()).filter(|&index| map[index].is_none()).collect()
}

/// The vertices reached from unmatched ones along alternating paths, as connected components: the
/// vertices of their side and those of the other side, ascending.
fn components(
    neighbours: &[Vec<usize>],
    matching: &[Option<usize>],
    unmatched: &[usize],
) -> Vec<(Vec<usize>, Vec<usize>)> {
    let mut component_of_other: Vec<Option<usize>> = vec![None; matching.len()];
    let mut components: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
    for &start in unmatched {
        let (mut own, mut other) = (vec![start], Vec::new());
        let mut stack = vec![start];
        let mut merged = Vec::new();
        while let Some(vertex) = stack.pop() {
            for &neighbour in &neighbours[vertex] {
                match component_of_other[neighbour] {
                    Some(index) if index != components.len() => merged.push(index),
                    Some(_) => {}
                    None => {
                        component_of_other[neighbour] = Some(components.len());
                        other.push(neighbour);
                        if let Some(partner) = matching[neighbour] {
                            own.push(partner);
                            stack.push(partner);
                        }
                    }
                }
            }
        }
        for index in merged {
            own.append(&mut components[index].0);
            let moved = std::mem::take(&mut components[index].1);
            moved.iter().for_each(|&vertex| component_of_other[vertex] = Some(components.len()));
            other.extend(moved);
        }
        components.push((own, other));
    }
    components.retain(|component| !component.0.is_empty());
    for (own, other) in &mut components {
        own.sort_unstable();
        other.sort_unstable();
    }
    components
}

/// The name of the derivative of a state: that of `x[3]` is `xdot[3]`.
fn derivative_name(state: &str) -> String {
    match state.strip_prefix("x[") {
        Some(rest) => format!("`xdot[{rest}`"),
        None => format!("the derivative of `{state}`"),
    }
}

fn count_phrase<'a>(one: &str, many: &str, items: &'a [usize], name: impl Fn(&'a usize) -> String) -> String {
    format!("{} {}", if items.len() == 1 { one } else { many }, listed_names(items, name))
}

/// `a`, `a and b`, `a, b and c`; of many names the first ones and their number.
fn listed_names<'a>(items: &'a [usize], name: impl Fn(&'a usize) -> String) -> String {
    const MAX_SHOWN: usize = 8;
    let mut names: Vec<String> = items.iter().take(MAX_SHOWN).map(name).collect();
    if items.len() > MAX_SHOWN {
        names.push(format!("{} more", items.len() - MAX_SHOWN));
    }
    match names.pop() {
        Some(last) if names.is_empty() => last,
        Some(last) => format!("{} and {last}", names.join(", ")),
        None => String::new(),
    }
}
