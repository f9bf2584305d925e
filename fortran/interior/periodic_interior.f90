!> Displacement and stress below a window that repeats: sums over waves.
!>
!> The tractions, linear between the nodes, are a Fourier series, whose coefficients are those of the nodal values times the sinc
!> functions of the hats. Each wave has fields that decay with the depth like exp(-kz), so the series ends where the waves are gone.
!>
!> Close to the surface too many waves would be left. The fields of a half-space at a depth z are smooth in z as far as tractions
!> at some distance cause them: those are extrapolated from depths z_j, the nodes of Chebyshev's interpolation,
!>
!>     sigma(z) = sum_j c_j sigma(z_j) + [sigma(z) - sum_j c_j sigma(z_j)],
!>
!> the first sum by waves, the bracket over the pyramids near the point.
!>
!> The mean tractions cause the uniform state sigma_zz = -p, sigma_az = -q_a, without stress in the plane. Displacements are those
!> from the mean.
!>
!> Equations: docs/theory/interior.md, (I23) to (I25).
module hc_periodic_interior
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_plane_transform, only: transform_plane
  use hc_layer_response, only: layer_t, layered_body_t, n_wave, ll_p, tt_p, zz_p, lz_p, ll_q, tt_q, zz_q, lz_q, tz_t, lt_t, &
                               uz_p, ul_p, uz_q, ul_q, ut_t
  use hc_depth_fields, only: depth_fields_t
  use hc_interior_fields, only: n_derivative, xx, yy, zz, xy, yz, xz
  use hc_interior_pyramid, only: interior_pyramid_t, new_interior_pyramid, most_points
  use hc_periodic_symbol, only: sinc
  !$ use omp_lib, only: omp_get_thread_num
  implicit none
  private

  public :: periodic_interior_t, new_periodic_interior, periodic_memory

  !> Components: the stress, then the displacement along x, y and z.
  integer, parameter :: u_x = 7, u_y = 8, u_z = 9, n_component = 9
  !> Wave number times depth beyond which waves are left out.
  real(wp), parameter :: gone = 27.0_wp
  !> Depth in spacings above which fields are extrapolated, from as many depths down to three times as deep, with the pyramids
  !> within a distance.
  real(wp), parameter :: shallow = 2.0_wp, near = 32.0_wp
  integer, parameter :: n_level = 8
  !> Points whose fields are summed at once.
  integer, parameter :: most_at_once = 256

  !> Tractions over a window that repeats, and the body below it.
  type :: periodic_interior_t
    private
    type(lattice_t) :: lattice
    type(layered_body_t) :: inside
    type(field_space_t) :: space
    type(interior_pyramid_t) :: pyramid
    !> Shear modulus of the surface, to which displacements refer [Pa]
    real(wp) :: shear_modulus = 1.0_wp
    !> Tractions on the body (component and step, column, row) [Pa]
    real(wp), allocatable :: load(:, :, :)
    !> Their Fourier coefficients (row, column, component, step) [Pa]
    complex(wp), allocatable :: wave(:, :, :, :)
  contains
    !> Displacement and stress at points; at the nodes of a plane
    procedure :: at_points, on_plane
  end type periodic_interior_t

  !> The fields at a depth, as those of waves and of the pyramids nearby.
  type :: depth_t
    type(layered_body_t) :: inside, half
    !> Depth [m], largest wave number [1/m]
    real(wp) :: z = 0.0_wp, largest = 0.0_wp
    !> Fields of the pyramids, none far from the surface: the first depth is z, the others are those of the waves
    type(depth_fields_t) :: near
    logical :: extrapolated = .false.
  contains
    procedure :: waves
  end type depth_t

contains

  !> Transform the tractions of a history of load steps.
  subroutine new_periodic_interior(self, lattice, body, inside, traction, space, error)
    !> Fields to be set up
    type(periodic_interior_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Number of the body
    integer, intent(in) :: body
    !> Its layers and the body below them
    type(layered_body_t), intent(in) :: inside
    !> Pressure and traction on body 1 along x and y (n_col, n_row, component, step) [Pa]
    real(wp), intent(in) :: traction(:, :, :, :)
    !> Who shares the work
    type(field_space_t), intent(in) :: space
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    complex(wp), allocatable :: field(:, :)
    type(layer_t) :: surface
    real(wp) :: side
    integer :: component, step, stat

    self%lattice = lattice
    self%inside = inside
    self%space = space
    surface = inside%material_at(0.0_wp)
    self%shear_modulus = surface%shear_modulus
    call new_interior_pyramid(self%pyramid, lattice%basis, sharp=.true.)
    associate (n => lattice%extent, n_step => size(traction, 4))
      allocate (self%wave(n(2), n(1), 3, n_step), self%load(3*n_step, n(1), n(2)), field(n(1), n(2)), stat=stat)
      if (stat /= 0) then
        call raise(error, status%resources, 'not enough memory for the stress: use fewer load steps')
        return
      end if
      do step = 1, n_step
        do component = 1, 3
          side = merge(-1.0_wp, 1.0_wp, body == 2 .and. component > 1)
          self%load(3*(step - 1) + component, :, :) = side*traction(:, :, component, step)
          field = side*traction(:, :, component, step)/product(real(n, wp))
          call transform_plane(field, self%wave(:, :, component, step), error)
          if (allocated(error)) return
        end do
      end do
    end associate
  end subroutine new_periodic_interior

  !> Count the bytes that planes take besides their results.
  pure integer(selected_int_kind(18)) function periodic_memory(extent, n_step)
    !> Number of columns and rows of the window, number of steps
    integer, intent(in) :: extent(2), n_step
    integer, parameter :: long = selected_int_kind(18)

    ! tractions and their coefficients; those of the pyramids nearby, of three loads; a few fields
    periodic_memory = product(int(extent, long))*(72*n_step + 3*16*6 + 3*16*6 + 8*16)
  end function periodic_memory

  !> Set up a depth.
  pure subroutine new_depth(self, at, z)
    class(periodic_interior_t), intent(in) :: self
    type(depth_t), intent(out) :: at
    !> Depth [m]
    real(wp), intent(in) :: z
    real(wp) :: level(n_level), weight(n_level), spacing, reach
    integer :: j, l

    at%inside = self%inside
    at%z = z
    reach = z
    spacing = self%lattice%spacing()
    at%extrapolated = z < shallow*spacing .and. self%inside%layer_at(z) == 1
    if (at%extrapolated) then
      allocate (at%half%layer(0))
      at%half%base = self%inside%material_at(z)
      reach = shallow*spacing
      if (size(self%inside%layer) > 0) then
        reach = min(reach, 2.0_wp*self%inside%layer(1)%thickness - z)
      end if
      level = [(spacing*shallow*(2.0_wp - cos(pi*(j - 0.5_wp)/n_level)), j=1, n_level)]
      weight = [(product((z - level)/(level(j) - level), mask=[(l /= j, l=1, n_level)]), j=1, n_level)]
      at%near%poisson_ratio = at%half%base%poisson_ratio
      at%near%depth = [z, level]
      at%near%weight = [1.0_wp, -weight]
      allocate (at%near%image(n_wave, n_level + 1), source=0.0_wp)
    end if
    at%largest = gone/reach
  end subroutine new_depth

  !> Compute the fields of waves of traction at a depth, (I23) and (I24); at k = 0 the uniform state.
  pure function waves(self, k) result(f)
    class(depth_t), intent(in) :: self
    !> Wave number [1/m]
    real(wp), intent(in) :: k
    real(wp) :: f(n_wave)
    integer :: j

    f = 0.0_wp
    if (.not. k > 0.0_wp) then
      f([zz_p, lz_q, tz_t]) = -1.0_wp
      return
    end if
    if (size(self%inside%layer) > 0 .or. .not. self%extrapolated) f = self%inside%at_depth(k, self%z)
    if (.not. self%extrapolated) return
    if (size(self%inside%layer) > 0) f = f - self%half%at_depth(k, self%z)
    do j = 2, n_level + 1
      f = f - self%near%weight(j)*self%half%at_depth(k, self%near%depth(j))
    end do
  end function waves

  !> Compute stress and displacement by a wave, from its fields in the plane of the wave vector.
  pure function turned(f, along, traction) result(field)
    !> Fields, of displacements over those by k
    real(wp), intent(in) :: f(n_wave)
    !> Direction of the wave vector
    real(wp), intent(in) :: along(2)
    !> Pressure and shear tractions along x and y
    complex(wp), intent(in) :: traction(3)
    complex(wp) :: field(n_component)
    complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
    complex(wp) :: ll, tt, lt, lz, tz, l, t, u

    associate (c => along(1), s => along(2), p => traction(1))
      l = c*traction(2) + s*traction(3)
      t = c*traction(3) - s*traction(2)
      ll = f(ll_p)*p + i*f(ll_q)*l
      tt = f(tt_p)*p + i*f(tt_q)*l
      lt = i*f(lt_t)*t
      lz = i*f(lz_p)*p + f(lz_q)*l
      tz = f(tz_t)*t
      field(xx) = ll*c*c + tt*s*s - 2.0_wp*c*s*lt
      field(yy) = ll*s*s + tt*c*c + 2.0_wp*c*s*lt
      field(xy) = (ll - tt)*c*s + lt*(c*c - s*s)
      field(zz) = f(zz_p)*p + i*f(zz_q)*l
      field(xz) = lz*c - tz*s
      field(yz) = lz*s + tz*c
      u = i*f(ul_p)*p + f(ul_q)*l
      t = f(ut_t)*t
      field(u_x) = u*c - t*s
      field(u_y) = u*s + t*c
      field(u_z) = f(uz_p)*p + i*f(uz_q)*l
    end associate
  end function turned

  !> Compute wave vector, its length, and the product of the sinc functions of a hat.
  pure subroutine wave_vector(lattice, number, k, along, hat)
    type(lattice_t), intent(in) :: lattice
    !> Numbers of waves along columns and rows
    integer, intent(in) :: number(2)
    !> Wave number [1/m]; direction, any for zero; transform of the hat over its volume
    real(wp), intent(out) :: k, along(2), hat
    real(wp) :: half(2)

    half = pi*number/lattice%extent
    associate (a => lattice%basis)
      along = 2.0_wp*[half(1)*a(2, 2) - half(2)*a(2, 1), half(2)*a(1, 1) - half(1)*a(1, 2)]/lattice%cell_area()
    end associate
    k = norm2(along)
    along = merge(along/max(k, tiny(k)), [1.0_wp, 0.0_wp], k > 0.0_wp)
    hat = sinc(half(1))*sinc(half(2))*sinc(half(2) - half(1))
  end subroutine wave_vector

  !> Compute displacement times the shear modulus, and stress, at points.
  subroutine at_points(self, points, displacement, stress, error)
    class(periodic_interior_t), intent(in) :: self
    !> Points, x, y and depth (3, n) [m]
    real(wp), intent(in) :: points(:, :)
    !> Displacement times the shear modulus (direction, point, step) [Pa m], stress (component, point, step) [Pa]
    real(wp), intent(out) :: displacement(:, :, :), stress(:, :, :)
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    type(depth_t) :: at
    real(wp), allocatable :: total(:, :, :)
    integer, allocatable :: alike(:)
    logical :: done(size(points, 2))
    integer :: first, i, stat

    done = .false.
    do
      first = findloc(done, .false., dim=1)
      if (first == 0) exit
      alike = pack([(i, i=1, size(done))], .not. done .and. abs(points(3, :) - points(3, first)) <= 0.0_wp)
      alike = alike(:min(size(alike), most_at_once))
      done(alike) = .true.
      call new_depth(self, at, points(3, first))
      if (allocated(total)) deallocate (total)
      allocate (total(n_component, size(self%wave, 4), size(alike)), source=0.0_wp, stat=stat)
      if (stat == 0) call add_waves(self, at, points(:2, alike), total, stat)
      if (stat /= 0) then
        call raise(error, status%resources, 'not enough memory for the stress: use fewer load steps')
        return
      end if
      if (at%extrapolated) call add_near(self, at, points(:, alike), total)
      do i = 1, size(alike)
        stress(:, alike(i), :) = total(:xz, :, i)
        displacement(:, alike(i), :) = total(u_x:, :, i)
      end do
    end do
  end subroutine at_points

  !> Add the waves at points of one depth.
  subroutine add_waves(self, at, points, total, stat)
    type(periodic_interior_t), intent(in) :: self
    type(depth_t), intent(in) :: at
    !> Points x and y (2, n) [m]
    real(wp), intent(in) :: points(:, :)
    !> Sums (component, step, point)
    real(wp), intent(inout), target, contiguous :: total(:, :, :)
    !> Not zero: not enough memory
    integer, intent(out) :: stat
    complex(wp), allocatable :: amplitude(:, :, :), turn(:, :)
    real(wp), allocatable :: part(:, :, :)
    real(wp) :: place(2, size(points, 2))
    integer :: most(2), a, b, thread

    associate (n => self%lattice%extent, lattice => self%lattice, n_sum => size(total, 1)*size(total, 2))
      ! both along the vectors of the lattice, in periods
      do a = 1, size(points, 2)
        associate (x => points(:, a) - lattice%origin - matmul(lattice%basis, real(lattice%first, wp)), basis => lattice%basis)
          place(:, a) = 2.0_wp*pi*[x(1)*basis(2, 2) - x(2)*basis(1, 2), x(2)*basis(1, 1) - x(1)*basis(2, 1)] &
                        /(lattice%cell_area()*n)
        end associate
      end do
      most = int(at%largest*n*norm2(lattice%basis, dim=1)/(2.0_wp*pi))
      allocate (turn(0:most(1), size(points, 2)), amplitude(n_sum, 0:most(1), self%space%threads), &
                part(n_sum, size(points, 2), self%space%threads), stat=stat)
      if (stat /= 0) return
      do a = 0, most(1)
        turn(a, :) = exp(cmplx(0.0_wp, a*place(1, :), wp))
      end do
      part = 0.0_wp
      thread = 1
      !$omp parallel do num_threads(self%space%threads) schedule(dynamic) firstprivate(thread)
      do b = -most(2), most(2)
        !$ thread = omp_get_thread_num() + 1
        call row_amplitudes(self, at, b, amplitude(:, :, thread))
        call add_row(amplitude(:, :, thread), turn, b*place(2, :), part(:, :, thread))
      end do
      !$omp end parallel do
      total = total + reshape(sum(part, dim=3), shape(total))
    end associate
  end subroutine add_waves

  !> Compute the amplitudes of all waves with a number of waves along rows.
  pure subroutine row_amplitudes(self, at, b, amplitude)
    type(periodic_interior_t), intent(in) :: self
    type(depth_t), intent(in) :: at
    integer, intent(in) :: b
    !> By component and step, and number of waves along columns
    complex(wp), intent(out) :: amplitude(:, 0:)
    real(wp) :: k, along(2), hat, f(n_wave)
    integer :: a, step

    amplitude = 0.0_wp
    do a = 0, ubound(amplitude, 2)
      ! of two opposite waves one, with twice its real part
      if (a == 0 .and. b < 0) cycle
      call wave_vector(self%lattice, [a, b], k, along, hat)
      if (k > at%largest) cycle
      f = at%waves(k)*hat*merge(1.0_wp, 2.0_wp, a == 0 .and. b == 0)
      f(uz_p:) = f(uz_p:)*self%shear_modulus/max(k, tiny(k))
      associate (at_node => modulo([a, b], self%lattice%extent) + 1)
        do step = 1, size(self%wave, 4)
          amplitude((step - 1)*n_component + 1:step*n_component, a) = &
            turned(f, along, self%wave(at_node(2), at_node(1), :, step))
        end do
      end associate
    end do
  end subroutine row_amplitudes

  !> Add the waves of a row at points.
  pure subroutine add_row(amplitude, turn, phase, part)
    complex(wp), intent(in) :: amplitude(:, 0:), turn(0:, :)
    !> Phase of the row at each point
    real(wp), intent(in) :: phase(:)
    real(wp), intent(inout) :: part(:, :)
    complex(wp) :: here(size(part, 1))
    integer :: i

    do i = 1, size(phase)
      here = matmul(amplitude, turn(:, i))
      part(:, i) = part(:, i) + real(here*exp(cmplx(0.0_wp, phase(i), wp)), wp)
    end do
  end subroutine add_row

  !> Add the correction of the waves by pyramids near a point, (I25).
  subroutine add_near(self, at, points, total)
    type(periodic_interior_t), intent(in) :: self
    type(depth_t), intent(in) :: at
    !> Points (3, n) [m]
    real(wp), intent(in) :: points(:, :)
    !> Sums (component, step, point)
    real(wp), intent(inout) :: total(:, :, :)
    real(wp), allocatable :: load(:, :), x(:, :), u(:, :), s(:, :), sums(:, :)
    integer :: i

    !$omp parallel do num_threads(self%space%threads) schedule(dynamic) private(load, x, u, s, sums)
    do i = 1, size(points, 2)
      call find_near(self, points(:2, i), x, load)
      allocate (u(3, size(total, 2)), s(xz, size(total, 2)), sums(n_derivative, size(load, 2)))
      call at%near%of_nodes(self%pyramid, x(:, 1), x(:, 2), load, sums, u, s)
      total(:xz, :, i) = total(:xz, :, i) + s
      total(u_x:, :, i) = total(u_x:, :, i) + u
      deallocate (u, s, sums)
    end do
    !$omp end parallel do
  end subroutine add_near

  !> Find the nodes near a point that carry traction.
  pure subroutine find_near(self, point, x, load)
    type(periodic_interior_t), intent(in) :: self
    !> x and y [m]
    real(wp), intent(in) :: point(2)
    !> The point relative to them (node, direction), in longest edges, and their tractions (node, component and step) [Pa]
    real(wp), allocatable, intent(out) :: x(:, :), load(:, :)
    integer, allocatable :: node(:, :)
    integer :: n, i

    associate (lattice => self%lattice, spacing => self%pyramid%spacing)
      call nodes_around(lattice, point, near*spacing, node)
      allocate (load(size(node, 2), size(self%load, 1)), x(size(node, 2), 2))
      n = 0
      do i = 1, size(node, 2)
        associate (inside => modulo(node(:, i) - lattice%first, lattice%extent) + 1)
          if (.not. any(abs(self%load(:, inside(1), inside(2))) > 0.0_wp)) cycle
          n = n + 1
          load(n, :) = self%load(:, inside(1), inside(2))
          x(n, :) = (point - lattice%origin - matmul(lattice%basis, real(node(:, i), wp)))/spacing
        end associate
      end do
      load = load(:n, :)
      x = x(:n, :)
    end associate
  end subroutine find_near

  !> List the nodes of the endless lattice within a distance of a point, column and row (2, n).
  pure subroutine nodes_around(lattice, point, distance, node)
    type(lattice_t), intent(in) :: lattice
    !> Point and distance [m]
    real(wp), intent(in) :: point(2), distance
    integer, allocatable, intent(out) :: node(:, :)
    real(wp) :: center(2), reach(2)
    integer :: low(2), high(2), col, row, n

    associate (a => lattice%basis, x => point - lattice%origin)
      center = [x(1)*a(2, 2) - x(2)*a(1, 2), x(2)*a(1, 1) - x(1)*a(2, 1)]/lattice%cell_area()
      reach = distance*norm2(a(:, 2:1:-1), dim=1)/lattice%cell_area()
      low = ceiling(center - reach)
      high = floor(center + reach)
      allocate (node(2, product(high - low + 1)))
      n = 0
      do row = low(2), high(2)
        do col = low(1), high(1)
          if (norm2(x - matmul(a, real([col, row], wp))) > distance) cycle
          n = n + 1
          node(:, n) = [col, row]
        end do
      end do
      node = node(:, :n)
    end associate
  end subroutine nodes_around

  !> Compute stress (6 components), or displacement times the shear modulus (3), at the nodes of a plane.
  subroutine on_plane(self, depth, field, error)
    class(periodic_interior_t), intent(in) :: self
    !> Depth [m]
    real(wp), intent(in) :: depth
    !> Stress [Pa] or displacement [Pa m] (n_col, n_row, component, step)
    real(wp), intent(out) :: field(:, :, :, :)
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    type(depth_t) :: at
    complex(wp), allocatable :: response(:, :, :, :), sums(:, :), back(:, :)
    integer :: c, step, stat, load, n_field, other

    n_field = size(field, 3)
    call new_depth(self, at, depth)
    associate (n => self%lattice%extent, first => merge(0, xz, n_field == xz))
      allocate (response(n(2), n(1), n_field, 3), sums(n(2), n(1)), back(n(1), n(2)), stat=stat)
      if (stat /= 0) then
        call raise(error, status%resources, 'not enough memory for the stress: use fewer load steps')
        return
      end if
      response = 0.0_wp
      if (at%extrapolated) call transform_near(self, at, first, response, error)
      if (allocated(error)) return
      call add_aliases(self, at, first, response)
      do step = 1, size(field, 4)
        do c = 1, n_field, 2
          ! two real fields as the parts of a complex one
          other = min(c + 1, n_field)
          sums = 0.0_wp
          do load = 1, 3
            sums = sums + self%wave(:, :, load, step)*(response(:, :, c, load) + (0.0_wp, 1.0_wp)*response(:, :, other, load))
          end do
          sums = conjg(sums)
          call transform_plane(sums, back, error)
          if (allocated(error)) return
          field(:, :, other, step) = -aimag(back)
          field(:, :, c, step) = real(back, wp)
        end do
      end do
    end associate
  end subroutine on_plane

  !> Add the waves at all frequencies of the window with their aliases.
  subroutine add_aliases(self, at, first, response)
    type(periodic_interior_t), intent(in) :: self
    type(depth_t), intent(in) :: at
    !> Components before the computed ones
    integer, intent(in) :: first
    !> Field over traction (row, column, component, load)
    complex(wp), intent(inout) :: response(:, :, :, :)
    complex(wp) :: field(n_component)
    complex(wp) :: unit(3)
    real(wp) :: k, along(2), hat, f(n_wave)
    integer :: most(2), col, a, b, load

    associate (lattice => self%lattice, n => self%lattice%extent)
      most = int(at%largest*n*norm2(lattice%basis, dim=1)/(2.0_wp*pi))
      ! threads have columns of their own
      !$omp parallel do num_threads(self%space%threads) schedule(dynamic) private(a, b, load, k, along, hat, f, field, unit)
      do col = 1, n(1)
        do a = -((most(1) + col - 1)/n(1))*n(1) + col - 1, most(1), n(1)
          do b = -most(2), most(2)
            call wave_vector(lattice, [a, b], k, along, hat)
            if (k > at%largest) cycle
            f = at%waves(k)*hat
            f(uz_p:) = f(uz_p:)*self%shear_modulus/max(k, tiny(k))
            associate (row => modulo(b, n(2)) + 1)
              do load = 1, 3
                unit = merge(1.0_wp, 0.0_wp, [1, 2, 3] == load)
                field = turned(f, along, unit)
                response(row, col, :, load) = response(row, col, :, load) + field(first + 1:first + size(response, 3))
              end do
            end associate
          end do
        end do
      end do
      !$omp end parallel do
    end associate
  end subroutine add_aliases

  !> Transform the fields of the pyramids nearby.
  subroutine transform_near(self, at, first, response, error)
    type(periodic_interior_t), intent(in) :: self
    type(depth_t), intent(in) :: at
    !> Components before the computed ones
    integer, intent(in) :: first
    !> Field over traction (row, column, component, load)
    complex(wp), intent(out) :: response(:, :, :, :)
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    complex(wp), allocatable :: table(:, :, :, :)
    real(wp), allocatable :: u(:, :, :), s(:, :, :)
    real(wp), dimension(most_points) :: x, y
    integer, allocatable :: node(:, :)
    integer :: i, m, c, load, from, last, there(2)

    associate (lattice => self%lattice, spacing => self%pyramid%spacing)
      allocate (table(lattice%extent(1), lattice%extent(2), size(response, 3), 3))
      table = 0.0_wp
      call nodes_around(lattice, lattice%origin, near*spacing, node)
      do from = 1, size(node, 2), most_points
        last = min(from + most_points - 1, size(node, 2))
        m = last - from + 1
        do i = 1, m
          associate (away => matmul(lattice%basis, real(node(:, from + i - 1), wp))/spacing)
            x(i) = away(1)
            y(i) = away(2)
          end associate
        end do
        allocate (u(m, 3, 3), s(m, xz, 3))
        call at%near%of_pyramid(self%pyramid, spacing, x(:m), y(:m), u, s)
        do i = 1, m
          there = modulo(node(:, from + i - 1), lattice%extent) + 1
          if (first == 0) then
            table(there(1), there(2), :, :) = table(there(1), there(2), :, :) + s(i, :, :)
          else
            table(there(1), there(2), :, :) = table(there(1), there(2), :, :) + spacing*u(i, :, :)
          end if
        end do
        deallocate (u, s)
      end do
      do load = 1, 3
        do c = 1, size(response, 3)
          call transform_plane(table(:, :, c, load), response(:, :, c, load), error)
          if (allocated(error)) return
        end do
      end do
    end associate
  end subroutine transform_near

end module hc_periodic_interior
