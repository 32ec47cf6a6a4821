//! What keywords open, and what their data lines add.

use super::super::draft::{Cell, DraftLine, DraftNode};
use super::super::kind::ElementKind;
use super::deck::{Deck, DeckPatch, DeckSurface, ElementBlock, Open, SetLines};
use super::elements::{self, Type};
use super::keyword::{Keyword, fields, key, number, real, unquoted};
use super::sets::{SetMember, SetScope, Sets, members, without_prefix};
use crate::error::{Error, Result};

const ONE_PART: &str = "write an input file of the specimen alone; parts that are glued: merge them with their meshes (Assembly > Instance > Merge/Cut > Mesh)";

impl Deck {
    fn scope(&self) -> SetScope {
        match self.open.last() {
            Some(Open::Assembly) => SetScope::Assembly,
            _ => SetScope::Part,
        }
    }

    /// Begin what a keyword stands for.
    pub fn open_block(&mut self, keyword: &Keyword) -> Result<()> {
        match keyword.name.as_str() {
            "PART" => self.open_level(Open::Part, keyword),
            "ASSEMBLY" => self.open_level(Open::Assembly, keyword),
            "INSTANCE" => self.open_level(Open::Instance, keyword),
            "ENDPART" => self.close_level(Open::Part),
            "ENDASSEMBLY" => self.close_level(Open::Assembly),
            "ENDINSTANCE" => self.close_level(Open::Instance),
            "NODE" => self.open_nodes(keyword),
            "ELEMENT" => self.open_elements(keyword),
            "NSET" | "ELSET" => self.open_set(keyword),
            "SURFACE" => self.open_surface(keyword),
            "NGEN" | "NFILL" | "NCOPY" | "NMAP" | "ELGEN" | "ELCOPY" | "SYSTEM" => {
                let found = format!("*{}, which makes or moves them", keyword.name);
                let error = self.error("nodes and elements that are listed, each on a line");
                Err(error.found(found).hint(
                    "read the file into Abaqus/CAE (File > Import > Model) and write it from there",
                ))
            }
            _ => Ok(()),
        }
    }

    fn open_level(&mut self, level: Open, keyword: &Keyword) -> Result<()> {
        let outer = (level == Open::Instance).then_some(&Open::Assembly);
        if self.open.last() != outer {
            let error = self.error("parts, then one assembly with an instance");
            return Err(error.found(format!("*{} here", keyword.name)));
        }
        self.open.push(level);
        let name = keyword.get("NAME").map(|n| unquoted(n).to_string());
        match level {
            Open::Part => {
                self.parts += 1;
                if self.parts > 1 {
                    return Err(self.error("one part").found("another one").hint(ONE_PART));
                }
                self.prefixes.extend(name.as_deref().map(key));
            }
            Open::Assembly => {}
            Open::Instance => {
                if self.instance.is_some() {
                    let error = self.error("one instance of one part");
                    return Err(error.found("another one").hint(ONE_PART));
                }
                let part = keyword.get("PART").map(key);
                let part = part.filter(|part| !self.prefixes.contains(part));
                if let Some(part) = part {
                    let error = self.error("an instance of the part above");
                    return Err(error.found(format!("one of {part}")).hint(ONE_PART));
                }
                self.prefixes.extend(name.as_deref().map(key));
                self.instance = Some(name.unwrap_or_else(|| "instance".to_string()));
                self.block = ElementBlock::Instance(0);
            }
        }
        Ok(())
    }

    fn close_level(&mut self, level: Open) -> Result<()> {
        if self.open.pop() == Some(level) {
            return Ok(());
        }
        let name = format!("{level:?}").to_uppercase();
        Err(self
            .error(format!("*{name} before *END {name}"))
            .found("none that is open"))
    }

    fn open_nodes(&mut self, keyword: &Keyword) -> Result<()> {
        let system = keyword.get("SYSTEM");
        if system.is_some_and(|s| !s.eq_ignore_ascii_case("R")) {
            let error = self.error("nodes in rectangular coordinates");
            return Err(error.found("SYSTEM=C or S").hint(
                "read the file into Abaqus/CAE and write it from there, which converts them",
            ));
        }
        let scope = self.scope();
        // the assembly's own nodes are reference points, with numbers of their own
        if scope == SetScope::Part {
            let sets = &mut self.node_sets;
            let set = keyword
                .get("NSET")
                .map(|name| sets.entry(name, scope, false));
            self.block = ElementBlock::Nodes(set);
        }
        Ok(())
    }

    fn open_elements(&mut self, keyword: &Keyword) -> Result<()> {
        let name = keyword.need("TYPE", || self.place())?.to_ascii_uppercase();
        let kind = elements::of(&name, || self.place())?;
        let scope = self.scope();
        if kind == Type::LeftOut {
            if let Some(set) = keyword.get("ELSET") {
                self.element_sets.entry(set, scope, false);
            }
            self.block = ElementBlock::LeftOut(scope == SetScope::Part);
            self.left_out = Some(name);
            return Ok(());
        }
        if scope == SetScope::Assembly {
            let error = self.error("elements of the part");
            return Err(error
                .found("elements of the assembly")
                .hint("delete them from the file"));
        }
        let sets = &mut self.element_sets;
        let set = keyword
            .get("ELSET")
            .map(|name| sets.entry(name, scope, false));
        self.block = ElementBlock::Elements(kind, set);
        Ok(())
    }

    fn open_set(&mut self, keyword: &Keyword) -> Result<()> {
        let name = keyword.need(&keyword.name, || self.place())?;
        let scope = self.scope();
        let is_internal = keyword.has("INTERNAL");
        let is_of_nodes = keyword.name == "NSET";
        let index = self.sets(is_of_nodes).entry(name, scope, is_internal);
        if let Some(elements) = keyword.get("ELSET").filter(|_| is_of_nodes) {
            let elements = without_prefix(elements, &self.prefixes).to_string();
            let member = (SetMember::NodesOf(elements), self.spot);
            self.node_sets.all[index].members.push(member);
        }
        self.block = ElementBlock::Set(SetLines {
            is_of_nodes,
            index,
            generate: keyword.has("GENERATE"),
            is_foreign: scope == SetScope::Assembly && !keyword.has("INSTANCE"),
        });
        Ok(())
    }

    fn open_surface(&mut self, keyword: &Keyword) -> Result<()> {
        let name = unquoted(keyword.need("NAME", || self.place())?).to_string();
        let kind = keyword
            .get("TYPE")
            .unwrap_or("ELEMENT")
            .to_ascii_uppercase();
        if !matches!(kind.as_str(), "ELEMENT" | "NODE") || keyword.has("COMBINE") {
            let place = self.place();
            self.draft.remarks.push(format!(
                "{place}: the surface {name} is left out: only those of TYPE=ELEMENT or NODE are read, without COMBINE"
            ));
            return Ok(());
        }
        self.surfaces.push(DeckSurface {
            name,
            scope: self.scope(),
            is_internal: keyword.has("INTERNAL"),
            is_of_nodes: kind == "NODE",
            patches: Vec::new(),
        });
        self.block = ElementBlock::Surface(self.surfaces.len() - 1);
        Ok(())
    }

    /// A data line.
    pub fn data(&mut self, line: &str) -> Result<()> {
        let fields = fields(line);
        match self.block {
            ElementBlock::Other => Ok(()),
            ElementBlock::Nodes(set) => self.node(&fields, set),
            ElementBlock::Elements(kind, set) => self.element(line, &fields, kind, set),
            ElementBlock::LeftOut(is_of_part) => {
                self.leave_out(line, &fields, is_of_part);
                Ok(())
            }
            ElementBlock::Set(lines) => self.set(&fields, lines),
            ElementBlock::Surface(index) => {
                let target = fields
                    .first()
                    .map(|f| without_prefix(f, &self.prefixes).to_string());
                let side = fields.get(1).map(|f| f.to_ascii_uppercase());
                if let (Some(target), Some(surface)) = (target, self.surfaces.get_mut(index)) {
                    surface.patches.push(DeckPatch {
                        target,
                        side: side.unwrap_or_default(),
                        spot: self.spot,
                    });
                }
                Ok(())
            }
            ElementBlock::Instance(lines) => self.moved(&fields, lines),
        }
    }

    fn node(&mut self, fields: &[&str], set: Option<usize>) -> Result<()> {
        let found = || fields.join(", ");
        let wrong = || {
            self.error("a node's number and its x, y and z")
                .found(found())
        };
        let Some(number) = fields.first().and_then(|f| number(f)) else {
            return Err(wrong());
        };
        if fields.len() < 3 {
            return Err(wrong().hint("the line is cut short: write the file again"));
        }
        let mut at = [0.0; 3];
        for (x, field) in at.iter_mut().zip(&fields[1..]) {
            *x = real(field).ok_or_else(wrong)?;
            if !x.is_finite() {
                let error = self.error(format!("finite coordinates of node {number}"));
                return Err(error.found(field));
            }
        }
        let spot = self.spot;
        self.draft.nodes.push(DraftNode { number, at, spot });
        self.node_sets.add(set, number, spot);
        Ok(())
    }

    fn element(
        &mut self,
        line: &str,
        fields: &[&str],
        kind: Type,
        set: Option<usize>,
    ) -> Result<()> {
        for field in fields {
            let wrong = || {
                self.error("the number of an element or a node")
                    .found(field)
            };
            let number = number(field).ok_or_else(wrong)?;
            self.element.push(number);
        }
        let wanted = 1 + kind.nodes();
        let goes_on = line.ends_with(',') && self.element.len() < wanted;
        if goes_on {
            return Ok(());
        }
        if self.element.len() != wanted {
            let expected = format!("an element's number and {} nodes", kind.nodes());
            let found = format!("{} numbers", self.element.len());
            let error = self.error(expected).found(found);
            return Err(
                error.hint("TYPE is another one than the nodes are for, or the line is cut short")
            );
        }
        self.add_element(kind, set);
        Ok(())
    }

    /// An element without area: only its number is kept, for the sets that have it.
    fn leave_out(&mut self, line: &str, fields: &[&str], is_of_part: bool) {
        let first = self.element.is_empty();
        if let Some(number) = fields.first().and_then(|f| number(f)).filter(|_| first) {
            if let Some(name) = self.left_out.take() {
                let place = self.place();
                self.draft.remarks.push(format!(
                    "{place}: elements {name} are left out: they have no area"
                ));
            }
            if is_of_part {
                self.draft.left_out.insert(number);
            }
            self.element.push(number);
        }
        if !line.ends_with(',') {
            self.element.clear();
        }
    }

    fn add_element(&mut self, kind: Type, set: Option<usize>) {
        let spot = self.spot;
        let number = self.element[0];
        let mut nodes = [Cell::NONE; 8];
        for (slot, node) in nodes.iter_mut().zip(&self.element[1..]) {
            *slot = *node;
        }
        self.element.clear();
        let is_shell = matches!(kind, Type::Shell(_) | Type::Nine);
        let kind = match kind {
            Type::Line(_) => {
                let nodes = [nodes[0], nodes[1], nodes[2]];
                self.draft.lines.push(DraftLine {
                    number,
                    nodes,
                    spot,
                });
                None
            }
            Type::Plane(kind) | Type::Shell(kind) => Some(kind),
            Type::Nine => Some(ElementKind::Q8),
            Type::LeftOut => None,
        };
        if let Some(kind) = kind {
            self.draft.cells.push(Cell {
                number,
                kind,
                nodes,
                is_shell,
                spot,
            });
        }
        self.element_sets.add(set, number, spot);
    }

    fn set(&mut self, fields: &[&str], lines: SetLines) -> Result<()> {
        let is_plain = |field: &&str| number(field).is_some();
        let own: Vec<&str> = fields
            .iter()
            .copied()
            .filter(|f| !(lines.is_foreign && is_plain(f)))
            .collect();
        if own.is_empty() {
            return Ok(());
        }
        let members = members(&own, lines.generate, &self.prefixes)
            .map_err(|expected| Error::input(self.place(), expected).found(fields.join(", ")))?;
        let spot = self.spot;
        if let Some(set) = self.sets(lines.is_of_nodes).all.get_mut(lines.index) {
            set.members
                .extend(members.into_iter().map(|member| (member, spot)));
        }
        Ok(())
    }

    fn sets(&mut self, are_of_nodes: bool) -> &mut Sets {
        match are_of_nodes {
            true => &mut self.node_sets,
            false => &mut self.element_sets,
        }
    }

    /// The data lines of the instance: a translation, then a rotation.
    fn moved(&mut self, fields: &[&str], lines: usize) -> Result<()> {
        if lines > 0 {
            let error = self.error("an instance that is only translated");
            return Err(error.found(format!("a rotation, {}", fields.join(", "))).hint(
                "rotate the part itself instead of the instance, or state the angle of the material axes in the model file and delete this line",
            ));
        }
        for (t, field) in self.translation.iter_mut().zip(fields) {
            let value = real(field).filter(|v| v.is_finite());
            *t = value.ok_or_else(|| {
                Error::input(self.draft.place(self.spot), "the instance's translation").found(field)
            })?;
        }
        self.block = ElementBlock::Instance(1);
        Ok(())
    }
}
