mod costs;
mod derivatives;
mod expression;
mod models;
mod rules;
mod simplification;
