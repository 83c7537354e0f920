//! Devices as inexact as the standard allows: shaders whose every operation is off by as much as it may be.
//!
//! `accuracy.rs` says how much that is. Two sound devices may differ by as much as a result changes when all
//! operations err, each up or down at random. The standard allows more that is not here: sums in another
//! order, subnormal numbers as 0, and interpolation and mixing in filters of no bounded precision.

mod accuracy;

use std::collections::HashMap;

use accuracy::{Error, ULP, error_of};
use naga::valid::FunctionInfo;
use naga::{
    Arena, BinaryOperator, Block, Expression, Function, Handle, ImageQuery, Literal, MathFunction, Range,
    SampleLevel, ScalarKind, Span, Statement, Type, TypeInner, UnaryOperator, UniqueArena, VectorSize,
};
use ndfmap_gpu::link;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Places of a filter between one texel and the next: Direct3D's eight bits, which all desktop devices
/// report. (Vulkan is content with four.)
const FILTER_STEPS: f32 = 256.0;

/// Size of exponents beyond which a single float is 0 or infinite, to the base e and 2.
const LARGEST_EXPONENT: f32 = 160.0;

/// Shader whose operations all err by as much as they may, each up or down by its own toss of a coin, as on
/// the inexact device of this number.
pub(crate) fn inexact(shader: &str, device: u64) -> String {
    let linked = link::check(shader.to_owned()).unwrap();
    let (mut module, info) = (linked.module, linked.info);
    let mut coins = Pcg64Mcg::seed_from_u64(device);
    let types = module.types.clone();
    let mut rewrite = |function: &mut Function, info: &FunctionInfo| {
        let kind = |(e, _): (Handle<Expression>, _)| Kind::of(info[e].ty.inner_with(&types));
        let kinds: Vec<_> = function.expressions.iter().map(kind).collect();
        rewrite(function, &kinds, &mut module.types, &mut coins);
    };
    for (handle, function) in module.functions.iter_mut() {
        rewrite(function, &info[handle]);
    }
    for (i, entry) in module.entry_points.iter_mut().enumerate() {
        rewrite(&mut entry.function, info.get_entry_point(i));
    }
    let flags = naga::valid::ValidationFlags::all();
    let info = naga::valid::Validator::new(flags, naga::valid::Capabilities::default()).validate(&module);
    let info = info.unwrap_or_else(|e| panic!("{e:?}"));
    naga::back::wgsl::write_string(&module, &info, naga::back::wgsl::WriterFlags::empty()).unwrap()
}

/// Kind of an expression, as far as its error depends on it.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Scalar,
    Vector(VectorSize),
    SquareMatrix(VectorSize),
    /// No float, vector or square matrix of floats: what is computed of it is exact.
    Other,
}

impl Kind {
    fn of(inner: &TypeInner) -> Self {
        match inner {
            TypeInner::Scalar(scalar) if scalar.kind == ScalarKind::Float => Self::Scalar,
            TypeInner::Vector { size, scalar } if scalar.kind == ScalarKind::Float => Self::Vector(*size),
            TypeInner::Matrix { columns, rows, .. } if columns == rows => Self::SquareMatrix(*columns),
            TypeInner::Matrix { .. } => unreachable!("no shader of ours has a matrix that is not square"),
            _ => Self::Other,
        }
    }
}

/// First and last expression that stand for one of the old function.
#[derive(Clone, Copy)]
struct Place {
    first: Handle<Expression>,
    last: Handle<Expression>,
}

/// Function under construction.
struct Rewrite<'a> {
    expressions: Arena<Expression>,
    /// Single floats by their bits: all literals come first, as no statement may compute them.
    literals: HashMap<u32, Handle<Expression>>,
    types: &'a mut UniqueArena<Type>,
    coins: &'a mut Pcg64Mcg,
}

/// Rewrites a function whose expressions are of these kinds.
fn rewrite(function: &mut Function, kinds: &[Kind], types: &mut UniqueArena<Type>, coins: &mut Pcg64Mcg) {
    let mut new = Rewrite { expressions: Arena::new(), literals: HashMap::new(), types, coins };
    let units = [1.0, 2.0, 2.5, 3.0, 4.0, 4.5, 6.0, 7.0, 8.5, 4096.0].map(|units| units * ULP);
    let errors = units.into_iter().chain([6.77e-5]).flat_map(|e| [e, -e]);
    let others = [FILTER_STEPS, LARGEST_EXPONENT, 0.0, 1.0, std::f32::consts::LN_2];
    for number in errors.chain([1.0 + 2.0 * ULP, 1.0 - 2.0 * ULP]).chain(others) {
        let literal = new.push(Expression::Literal(Literal::F32(number)));
        new.literals.insert(number.to_bits(), literal);
    }
    let old = std::mem::take(&mut function.expressions);
    let mut places: Vec<Place> = Vec::new();
    for (handle, expression) in old.iter() {
        let mut operation = expression.clone();
        for_each_operand(&mut operation, &mut |operand| *operand = places[operand.index()].last);
        let start = new.expressions.len();
        let operand_kind = |old: Handle<Expression>| kinds[old.index()];
        new.operation(expression, operation, kinds[handle.index()], operand_kind);
        let mut made = new.expressions.range_from(start);
        let first = made.next().unwrap();
        places.push(Place { first, last: made.last().unwrap_or(first) });
    }
    function.expressions = new.expressions;
    let place = |handle: Handle<Expression>| places[handle.index()];
    for (_, local) in function.local_variables.iter_mut() {
        local.init = local.init.map(|init| place(init).last);
    }
    function.named_expressions =
        function.named_expressions.drain(..).map(|(handle, name)| (place(handle).last, name)).collect();
    rewrite_block(&mut function.body, &place);
}

impl Rewrite<'_> {
    fn push(&mut self, expression: Expression) -> Handle<Expression> {
        self.expressions.append(expression, Span::UNDEFINED)
    }

    fn literal(&self, number: f32) -> Handle<Expression> {
        self.literals[&number.to_bits()]
    }

    /// Error of this much, up or down by a coin.
    fn toss(&mut self, by: f32) -> Handle<Expression> {
        let by = if self.coins.random() { by } else { -by };
        self.literal(by)
    }

    /// Scalar in each component of a kind.
    fn splat(&mut self, value: Handle<Expression>, kind: Kind) -> Handle<Expression> {
        match kind {
            Kind::Vector(size) => self.push(Expression::Splat { size, value }),
            _ => value,
        }
    }

    fn binary(
        &mut self,
        op: BinaryOperator,
        left: Handle<Expression>,
        right: Handle<Expression>,
    ) -> Handle<Expression> {
        self.push(Expression::Binary { op, left, right })
    }

    /// Appends an operation, and what makes it err. `old` has the operands of the old function.
    fn operation(
        &mut self,
        old: &Expression,
        mut operation: Expression,
        kind: Kind,
        kind_of: impl Fn(Handle<Expression>) -> Kind,
    ) {
        self.snap_between_texels(&mut operation);
        if kind == Kind::Other {
            self.push(operation);
            return;
        }
        match (old, &mut operation) {
            (
                Expression::Math { fun: MathFunction::Dot | MathFunction::Cross, arg: from, .. },
                Expression::Math { arg, .. },
            ) => *arg = self.loosen(*arg, kind_of(*from)),
            (
                Expression::Math { fun: MathFunction::Mix, arg: from, .. },
                Expression::Math { arg, arg1: Some(other), .. },
            ) => {
                *arg = self.loosen(*arg, kind_of(*from));
                *other = self.loosen(*other, kind_of(*from));
            }
            (
                Expression::Binary { op: BinaryOperator::Multiply, left: matrix, right: from },
                Expression::Binary { right, .. },
            ) if matches!(kind_of(*matrix), Kind::SquareMatrix(_)) && kind_of(*from) != Kind::Scalar => {
                *right = self.loosen(*right, kind_of(*from));
            }
            (
                Expression::Binary { op: BinaryOperator::Multiply, left: from, right: matrix },
                Expression::Binary { left, .. },
            ) if matches!(kind_of(*matrix), Kind::SquareMatrix(_)) && kind_of(*from) != Kind::Scalar => {
                *left = self.loosen(*left, kind_of(*from));
            }
            _ => {}
        }
        let (error, argument) = (error_of(old), first_argument(&operation));
        let exact = self.push(operation);
        match error {
            None => {}
            Some(Error::Ulps(units)) => {
                // A sum, for a factor above one would round units to whole ones.
                let share = self.toss(units * ULP);
                let error = self.binary(BinaryOperator::Multiply, exact, share);
                self.binary(BinaryOperator::Add, exact, error);
            }
            Some(Error::Absolute(by)) => {
                let by = self.toss(by);
                let by = self.splat(by, kind);
                self.binary(BinaryOperator::Add, exact, by);
            }
            Some(Error::Exponential) => {
                let (fixed, per_x) = (self.toss(3.0 * ULP), self.toss(2.0 * ULP));
                let (x, most) =
                    (self.math(MathFunction::Abs, argument.unwrap()), self.literal(LARGEST_EXPONENT));
                // The exponential of what is larger is 0 or infinite on any device.
                let most = self.splat(most, kind);
                let (fun, arg1) = (MathFunction::Min, Some(most));
                let x = self.push(Expression::Math { fun, arg: x, arg1, arg2: None, arg3: None });
                let more = self.binary(BinaryOperator::Multiply, x, per_x);
                let fixed = self.splat(fixed, kind);
                let share = self.binary(BinaryOperator::Add, fixed, more);
                let error = self.binary(BinaryOperator::Multiply, exact, share);
                self.binary(BinaryOperator::Add, exact, error);
            }
            Some(Error::Logarithm(within)) => {
                let (near, units) = (self.toss(4.0 * ULP), self.toss(3.0 * ULP));
                let accept = self.splat(near, kind);
                let reject = self.binary(BinaryOperator::Multiply, exact, units);
                let (size, within) = (self.math(MathFunction::Abs, exact), self.literal(within));
                let within = self.splat(within, kind);
                let condition = self.binary(BinaryOperator::Less, size, within);
                let error = self.push(Expression::Select { condition, accept, reject });
                self.binary(BinaryOperator::Add, exact, error);
            }
        }
    }

    fn math(&mut self, fun: MathFunction, arg: Handle<Expression>) -> Handle<Expression> {
        self.push(Expression::Math { fun, arg, arg1: None, arg2: None, arg3: None })
    }

    /// Argument of a sum of products, its components off by two units each: they stand for the roundings of
    /// the terms, which are no share of the sum where terms cancel.
    fn loosen(&mut self, argument: Handle<Expression>, kind: Kind) -> Handle<Expression> {
        let factor = |new: &mut Self| {
            let factor = if new.coins.random() { 1.0 + 2.0 * ULP } else { 1.0 - 2.0 * ULP };
            new.literal(factor)
        };
        let factors = match kind {
            Kind::Scalar => factor(self),
            Kind::Vector(size) => {
                let components = (0..size as usize).map(|_| factor(self)).collect();
                let ty = self.vector(size);
                self.push(Expression::Compose { ty, components })
            }
            Kind::SquareMatrix(size) => {
                // diag(1 + e) times the matrix: the terms of a product of matrices err by their row here.
                let (zero, ty) = (self.literal(0.0), self.vector(size));
                let column = |new: &mut Self, k| {
                    let diagonal = factor(new);
                    let components = (0..size as usize).map(|i| if i == k { diagonal } else { zero });
                    new.push(Expression::Compose { ty, components: components.collect() })
                };
                let components = (0..size as usize).map(|k| column(self, k)).collect();
                let inner = TypeInner::Matrix { columns: size, rows: size, scalar: naga::Scalar::F32 };
                let ty = self.types.insert(Type { name: None, inner }, Span::UNDEFINED);
                self.push(Expression::Compose { ty, components })
            }
            Kind::Other => return argument,
        };
        self.binary(BinaryOperator::Multiply, factors, argument)
    }

    fn vector(&mut self, size: VectorSize) -> Handle<Type> {
        let inner = TypeInner::Vector { size, scalar: naga::Scalar::F32 };
        self.types.insert(Type { name: None, inner }, Span::UNDEFINED)
    }

    /// Snaps the place of a look-up at a whole level to the filter's steps.
    fn snap_between_texels(&mut self, operation: &mut Expression) {
        let Expression::ImageSample { image, coordinate, level: SampleLevel::Exact(level), .. } = operation
        else {
            return;
        };
        // Texels of the level: 2^-level of the finest. (lavapipe may answer with another pixel's level.)
        let size =
            self.push(Expression::ImageQuery { image: *image, query: ImageQuery::Size { level: None } });
        let size = self.push(Expression::As { expr: size, kind: ScalarKind::Float, convert: Some(4) });
        let finer = self.push(Expression::Unary { op: UnaryOperator::Negate, expr: *level });
        let share = self.math(MathFunction::Exp2, finer);
        let texels = self.binary(BinaryOperator::Multiply, size, share);
        let steps = self.binary(BinaryOperator::Multiply, texels, self.literal(FILTER_STEPS));
        let place = self.binary(BinaryOperator::Multiply, *coordinate, steps);
        let place = self.math(MathFunction::Round, place);
        *coordinate = self.binary(BinaryOperator::Divide, place, steps);
    }
}

fn first_argument(operation: &Expression) -> Option<Handle<Expression>> {
    match operation {
        Expression::Math { arg, .. } => Some(*arg),
        _ => None,
    }
}

/// Visits the operands of an expression, of the kinds that our shaders have.
fn for_each_operand(expression: &mut Expression, visit: &mut impl FnMut(&mut Handle<Expression>)) {
    match expression {
        Expression::Literal(_)
        | Expression::Constant(_)
        | Expression::Override(_)
        | Expression::ZeroValue(_)
        | Expression::FunctionArgument(_)
        | Expression::GlobalVariable(_)
        | Expression::LocalVariable(_)
        | Expression::CallResult(_) => {}
        Expression::Compose { components, .. } => components.iter_mut().for_each(visit),
        Expression::Access { base, index } => [base, index].into_iter().for_each(visit),
        Expression::AccessIndex { base: operand, .. }
        | Expression::Splat { value: operand, .. }
        | Expression::Swizzle { vector: operand, .. }
        | Expression::Load { pointer: operand }
        | Expression::Unary { expr: operand, .. }
        | Expression::As { expr: operand, .. }
        | Expression::Derivative { expr: operand, .. }
        | Expression::Relational { argument: operand, .. }
        | Expression::ArrayLength(operand) => visit(operand),
        Expression::Binary { left, right, .. } => [left, right].into_iter().for_each(visit),
        Expression::Select { condition, accept, reject } => {
            [condition, accept, reject].into_iter().for_each(visit);
        }
        Expression::Math { arg, arg1, arg2, arg3, .. } => {
            visit(arg);
            [arg1, arg2, arg3].into_iter().flatten().for_each(visit);
        }
        Expression::ImageSample {
            image, sampler, coordinate, array_index, offset, level, depth_ref, ..
        } => {
            [image, sampler, coordinate].into_iter().for_each(&mut *visit);
            [array_index, offset, depth_ref].into_iter().flatten().for_each(&mut *visit);
            match level {
                SampleLevel::Auto | SampleLevel::Zero => {}
                SampleLevel::Exact(level) | SampleLevel::Bias(level) => visit(level),
                SampleLevel::Gradient { x, y } => [x, y].into_iter().for_each(visit),
            }
        }
        Expression::ImageLoad { image, coordinate, array_index, sample, level } => {
            [image, coordinate].into_iter().for_each(&mut *visit);
            [array_index, sample, level].into_iter().flatten().for_each(visit);
        }
        Expression::ImageQuery { image, query } => {
            visit(image);
            if let ImageQuery::Size { level: Some(level) } = query {
                visit(level);
            }
        }
        other => unreachable!("no shader of ours has {other:?}"),
    }
}

/// Points the statements of a block to the new expressions.
fn rewrite_block(block: &mut Block, place: &impl Fn(Handle<Expression>) -> Place) {
    let point = |handle: &mut Handle<Expression>| *handle = place(*handle).last;
    for statement in block.iter_mut() {
        match statement {
            Statement::Emit(range) => {
                if let Some((first, last)) = range.first_and_last() {
                    *range = Range::new_from_bounds(place(first).first, place(last).last);
                }
            }
            Statement::Block(inner) => rewrite_block(inner, place),
            Statement::If { condition, accept, reject } => {
                point(condition);
                rewrite_block(accept, place);
                rewrite_block(reject, place);
            }
            Statement::Switch { selector, cases } => {
                point(selector);
                cases.iter_mut().for_each(|case| rewrite_block(&mut case.body, place));
            }
            Statement::Loop { body, continuing, break_if } => {
                rewrite_block(body, place);
                rewrite_block(continuing, place);
                break_if.iter_mut().for_each(point);
            }
            Statement::Return { value } => value.iter_mut().for_each(point),
            Statement::Store { pointer, value } => [pointer, value].into_iter().for_each(point),
            Statement::Call { arguments, result, .. } => {
                arguments.iter_mut().for_each(point);
                result.iter_mut().for_each(point);
            }
            Statement::ImageStore { image, coordinate, array_index, value } => {
                [image, coordinate, value].into_iter().for_each(point);
                array_index.iter_mut().for_each(point);
            }
            Statement::Break | Statement::Continue | Statement::Kill => {}
            other => unreachable!("no shader of ours has {other:?}"),
        }
    }
}
