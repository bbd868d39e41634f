mod costs;
mod derivatives;
mod expression;
mod models;
mod properties;
mod rules;
mod simplification;
