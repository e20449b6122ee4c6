//! Model 2 of Whitcomb & Yoerger in one readable file, nothing imported: the equations as
//! printed, angles and all, numbers from their Figure 7. The crate is tested against it.
//!
//! `cargo run -p kort-thruster --example plain` prints the 9.2 N m torque step.

/// Thrust and torque of the blades for shaft speed, rad/s, and axial flow, m/s: (14)-(17).
pub fn blades(om: f64, vp: f64) -> (f64, f64) {
    let (r, p, rho, cl_max, cd_max): (f64, f64, f64, f64, f64) = (0.13, 0.39, 998.0, 0.542, 1.25);
    let a = std::f64::consts::PI * r * r;
    let ut = 0.7 * r * om; // (15)
    let v = (vp * vp + ut * ut).sqrt();
    let theta = vp.atan2(ut);
    let alpha = p - theta;
    let cl = cl_max * (2.0 * alpha).sin(); // (17)
    let cd = cd_max * (1.0 - (2.0 * alpha).cos());
    let lift = 0.5 * rho * v * v * a * cl; // (16)
    let drag = 0.5 * rho * v * v * a * cd;
    let thrust = lift * theta.cos() - drag * theta.sin(); // (14)
    let torque = 0.7 * r * (lift * theta.sin() + drag * theta.cos());
    (thrust, torque)
}

/// `(Om', vp')` under a motor torque, N m: (10) without friction, and (13).
pub fn rates(om: f64, vp: f64, tau: f64) -> (f64, f64) {
    let (r, l, rho, dbeta, gamma, inertia): (f64, f64, f64, f64, f64, f64) =
        (0.13, 0.1271, 998.0, 1.86, 2.0, 0.01);
    let a = std::f64::consts::PI * r * r;
    let m = rho * a * l * gamma;
    let (thrust, torque) = blades(om, vp);
    ((tau - torque) / inertia, thrust / m - dbeta / (l * gamma) * vp * vp.abs())
}

/// One Runge-Kutta step of order 4.
pub fn step(om: f64, vp: f64, tau: f64, dt: f64) -> (f64, f64) {
    let (a1, b1) = rates(om, vp, tau);
    let (a2, b2) = rates(om + dt / 2.0 * a1, vp + dt / 2.0 * b1, tau);
    let (a3, b3) = rates(om + dt / 2.0 * a2, vp + dt / 2.0 * b2, tau);
    let (a4, b4) = rates(om + dt * a3, vp + dt * b3, tau);
    (om + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4), vp + dt / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4))
}

#[allow(dead_code)] // not called where a test includes this file
fn main() {
    let (mut om, mut vp) = (0.0, 0.0);
    println!("time_s,shaft_speed_rad_s,flow_m_s,thrust_n,torque_n_m");
    for k in 0..=1000 {
        if k % 20 == 0 {
            let (thrust, torque) = blades(om, vp);
            println!("{:.3},{om:.3},{vp:.4},{thrust:.2},{torque:.3}", f64::from(k) * 0.001);
        }
        (om, vp) = step(om, vp, 9.2, 0.001);
    }
}
