//! Terms of `trueangle.terms` as those of the core.

use pyo3::prelude::*;

use super::failure::argument_error;
use crate::terms::{Form, Line, Signal, Term};

/// What the names of other joints' angles begin with.
pub const OTHER: &str = "coupled_";

/// The forms of a term of `trueangle.terms`, each with the name of the term, and the names of
/// the other joints' angles that they need, in the order of [`Signal::OTHERS`].
pub fn forms(terms: &[Bound<'_, PyAny>]) -> PyResult<(Vec<Term>, Vec<String>)> {
    let mut forms = Vec::new();
    let mut others = Vec::new();
    for term in terms {
        let name: String = term.getattr("kind")?.extract()?;
        for object in term.call_method0("forms")?.try_iter()? {
            forms.push(Term {
                name: name.clone(),
                form: form(&object?, &mut others)?,
            });
        }
    }
    Ok((forms, others))
}

/// A form of `trueangle.model.forms`, read attribute by attribute.
fn form(object: &Bound<'_, PyAny>, others: &mut Vec<String>) -> PyResult<Form> {
    let number = |name: &str| object.getattr(name)?.extract::<f64>();
    let option = |name: &str| object.getattr(name)?.extract::<Option<f64>>();
    let kind: String = object.get_type().name()?.extract()?;
    Ok(match kind.as_str() {
        "Play" => Form::Play {
            half_width: number("half_width")?,
            lines: lines(object)?,
        },
        "Friction" => Form::Friction {
            amplitude: number("amplitude")?,
            length: number("length")?,
            start: number("start")?,
        },
        "Lag" => Form::Lag {
            delay: number("delay")?,
        },
        "Filter" => Form::Filter {
            frequency: number("frequency")?,
            damping: option("damping")?,
        },
        "Scaled" => Form::Scaled {
            signal: signal(object, others)?,
            origin: number("origin")?,
            absolute: object.getattr("absolute")?.extract()?,
            level: number("level")?,
            relative: number("relative")?,
            lines: lines(object)?,
        },
        "Spring" => Form::Spring {
            signal: signal(object, others)?,
            linear: number("linear")?,
            cubic: number("cubic")?,
            beyond: number("beyond")?,
            knee: number("knee")?,
            gravity: option("gravity")?,
        },
        "Bump" => Form::Bump {
            place: number("place")?,
            width: number("width")?,
            height: number("height")?,
            cycles: number("cycles")?,
        },
        "Ramp" => Form::Ramp {
            slope: number("slope")?,
            start: number("start")?,
            stop: number("stop")?,
        },
        other => {
            return Err(argument_error(
                object.py(),
                format!("the core knows no form {other:?}"),
            ));
        }
    })
}

/// The signal of a keyword argument: one that all know, or the angle of one of `others`.
pub fn signal_of(name: &str, others: &[String]) -> Option<Signal> {
    let place = || others.iter().position(|other| other == name);
    Signal::named(name).or_else(|| Signal::OTHERS.get(place()?).copied())
}

fn signal(object: &Bound<'_, PyAny>, others: &mut Vec<String>) -> PyResult<Signal> {
    let name: String = object.getattr("signal")?.extract()?;
    if name.starts_with(OTHER) && !others.contains(&name) {
        others.push(name.clone());
        if others.len() > Signal::OTHERS.len() {
            let problem = format!(
                "a model may be coupled to {} other joints, not to {}",
                Signal::OTHERS.len(),
                others.join(", ")
            );
            return Err(argument_error(object.py(), problem));
        }
    }
    signal_of(&name, others).ok_or_else(|| {
        let problem = format!("a correction knows no signal {name:?}");
        argument_error(object.py(), problem)
    })
}

fn lines(object: &Bound<'_, PyAny>) -> PyResult<Vec<Line>> {
    let lines: Vec<(f64, f64, f64)> = object.getattr("lines")?.extract()?;
    Ok(lines
        .into_iter()
        .map(|(order, cosine, sine)| Line {
            order,
            cosine,
            sine,
        })
        .collect())
}
