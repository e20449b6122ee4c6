% Run by beside_mss.py: octave-cli beside_mss.m MSS FOLDER. What MSS's own functions say, as CSV in FOLDER, and the times they take on the output.
warning("off", "all");   # wageningen.m loads its table anew at each call, and Octave warns of each
args = argv(); folder = args{2}; addpath(genpath(args{1}));

% Propeller of remus100.m: B-series, 3 blades, area ratio 0.718, pitch ratio 1.
J = (0:0.02:0.96)'; tic;
for i = 1:numel(J), [KT(i, 1), KQ(i, 1)] = wageningen(J(i), 1, 0.718, 3); end
printf("curve_s\t%.2f\n", toc);
dlmwrite([folder "/curve.csv"], [J KT KQ], "precision", 9);

% What remus100's propeller gives to the hull: its force with the shaft at n_rpm less that with the shaft at rest.
function [thrust_n, torque_n_m] = propeller(x, n_rpm)
  [with, ~, M] = remus100(x, [0; 0; n_rpm]); without = remus100(x, [0; 0; 0]);
  force = M * (with(1:6) - without(1:6));
  thrust_n = force(1) / 0.9; torque_n_m = 10 * force(4);   # remus100 takes off a thrust deduction of 0.1 and divides the torque by 10
end

% A step of the command to 1525 rpm from rest: the shaft follows as npsauv's does, the vehicle is remus100.
h_s = 0.02; end_s = 10; n_cmd_rpm = 1525; shaft = zeros(17, 1); x = zeros(12, 1); row = 0; tic;
for t_s = 0:h_s:end_s
  n_rpm = min(shaft(17), n_cmd_rpm);
  row += 1; course(row, 1:3) = [t_s, n_rpm, x(1)];
  states(:, row) = x;
  k1 = npsauv(shaft, [0; 0; 0; 0; n_cmd_rpm]);
  shaft(17) += h_s * k1(17);
  x = rk4(@remus100, h_s, x, [0; 0; n_rpm]);
end
printf("step_s\t%.0f\n", toc);
for i = 1:row, [course(i, 4), course(i, 5)] = propeller(states(:, i), course(i, 2)); end
dlmwrite([folder "/step.csv"], course, "precision", 9);

% Identification. MSS has none for a thruster: its two forms of thrust, by least squares on the first half of a recording.
function report(folder, name)
  file = fopen([folder "/" name ".csv"]); columns = strsplit(fgetl(file), ","); fclose(file);
  table = dlmread([folder "/" name ".csv"], ",", 1, 0);
  at = @(column) table(:, strcmp(columns, column));
  w = at("shaft_speed_rad_s"); T = at("thrust_n"); u = at("flow_held_m_s"); half = 1:floor(rows(table) / 2); rest = half(end) + 1:rows(table);
  forms = {"otter", [w .* abs(w) .* (w > 0), w .* abs(w) .* (w <= 0)]; "remus100", [w .* abs(w), abs(w) .* u]};
  for i = 1:2
    A = forms{i, 2}; k = A(half, :) \ T(half);
    left = sqrt(mean((T(rest) - A(rest, :) * k) .^ 2)) / max(abs(T));
    printf("%s %s\t%.2f %%, coefficients %s\n", name, forms{i, 1}, 100 * left, mat2str(k', 4));
  end
end
tic; report(folder, "nothing"); report(folder, "friction"); printf("identify_s\t%.2f\n", toc);
