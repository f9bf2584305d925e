!> Search for the place and the size of a contact, from which its window follows.
!>
!> The frictionless problem is solved roughly on a coarse lattice, which is first enlarged until the contact lies inside and
!> then refined until the contact is some sixteen nodes across where it is narrowest, for any shape. The caller evaluates the
!> gap at the nodes of each lattice:
!>
!>     call search%begin(half_size, center, cell_ratio)
!>     do while (search%verdict == pending)
!>       ... set up the lattice of search%spacing, search%first and search%extent, and evaluate the gap at its nodes ...
!>       call find_rough_pressure(lattice, medium, law, gap, target, pressure, error)
!>       call search%judge(lattice, pressure)
!>     end do
!>
!> Bounds are in lattice coordinates, lengths along the two basis vectors, since windows are parallelograms.
module hc_contact_search
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_rint
  use hc_precision, only: wp, pi
  use hc_error, only: error_t
  use hc_memory, only: require_memory
  use hc_lattice, only: lattice_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_normal_law, only: normal_law_t
  use hc_contact_state, only: contact_state_t, load_target_t
  use hc_normal_contact, only: normal_contact_t, new_normal_contact, normal_contact_memory
  use hc_step_control, only: accepted, failed, pending
  use hc_field_space, only: field_space_t
  use hc_window_growth, only: grown_window
  implicit none
  private

  public :: contact_search_t, find_rough_pressure

  !> Spacings along a side of the first window, whose length over the guessed half-width of the contact is `first_side`.
  integer, parameter :: start_nodes = 32
  real(wp), parameter :: first_side = 2.5_wp
  !> Spacings in the smaller half-width of the contact: good to a few per cent. A lattice is refined by the largest factor at most.
  real(wp), parameter :: narrow_nodes = 8.0_wp, least_factor = 2.0_wp, largest_factor = 8.0_wp
  !> Nodes up to which a lattice is refined; lattices, and enlargements among them: a contact along a line has no end.
  real(wp), parameter :: most_nodes = 40000.0_wp
  !> Times as many, to which one grows: contacts of waves, spot by spot, have no end.
  real(wp), parameter :: largest_growth = 16.0_wp
  integer, parameter :: most_trials = 24, most_enlargements = 12
  !> Residual and iterations of a rough solution.
  real(wp), parameter :: roughly = 1.0e-4_wp
  integer, parameter :: max_sweeps = 200
  !> Numbers that are added one after the other, in a sum of many.
  integer, parameter :: n_lane = 8, n_block = 128

  !> A search: the next lattice, and the contact on the last one.
  type :: contact_search_t
    !> Spacing of the next lattice [m], its first column and row, and its numbers of columns and rows: whole numbers of any size
    real(wp) :: spacing = 0.0_wp, first(2) = 0.0_wp, extent(2) = 0.0_wp
    !> Point about which lattices lie, in lattice coordinates [m], and length of the second basis vector over that of the first
    real(wp) :: center(2) = 0.0_wp, cell_ratio = 1.0_wp
    !> Number of lattices so far, and of enlargements among them; whether one of them held the contact
    integer :: n_tried = 0, n_enlarged = 0
    logical :: encloses = .false.
    !> `pending`: the next lattice is to be solved on; `accepted`: the contact is found; `failed`: it has no end, or nothing touches
    integer :: verdict = pending
    !> Nodes in contact, and the largest pressure [Pa]
    integer :: n_contact = 0
    real(wp) :: max_pressure = 0.0_wp
    !> Smallest and largest lattice coordinates of the contact, and its extent between nodes along x and y [m]
    real(wp) :: lower(2) = 0.0_wp, upper(2) = 0.0_wp, size(2) = 0.0_wp
    !> Second moments xx, yy, xy of its nodes about their centroid [m^2]
    real(wp) :: moment(3) = 0.0_wp
    !> Twice the area of the contact over the length of its edge, the radius of equal discs [m]
    real(wp) :: breadth = 0.0_wp
  contains
    procedure :: begin, judge
    procedure, private :: put_around, refine, measure, half_width
  end type contact_search_t

contains

  !> Begin a search about a point.
  pure subroutine begin(self, half_size, center, cell_ratio)
    class(contact_search_t), intent(inout) :: self
    !> Guess of the half-width of the contact [m]
    real(wp), intent(in) :: half_size
    !> The point in lattice coordinates [m]
    real(wp), intent(in) :: center(2)
    !> Length of the second basis vector over that of the first
    real(wp), intent(in) :: cell_ratio

    self%center = center
    self%cell_ratio = cell_ratio
    self%extent = start_nodes + 1
    call self%put_around(first_side*half_size/start_nodes)
  end subroutine begin

  !> Judge the pressure on the present lattice: measure the contact, or set the next lattice.
  subroutine judge(self, lattice, pressure)
    class(contact_search_t), intent(inout) :: self
    !> The present lattice
    type(lattice_t), intent(in) :: lattice
    !> Pressure at its nodes (n_col, n_row) [Pa]
    real(wp), intent(in) :: pressure(:, :)
    type(lattice_t) :: larger
    logical :: contact(size(pressure, 1), size(pressure, 2)), refined
    real(wp) :: across, half_width

    contact = pressure > 0.0_wp
    self%n_tried = self%n_tried + 1
    if (.not. any(contact)) then
      ! under a load there is always contact; at an approach it may lie between the nodes
      call self%put_around(self%spacing/4)
    else if (any(contact([1, size(contact, 1)], :)) .or. any(contact(:, [1, size(contact, 2)]))) then
      if (self%encloses) then
        larger = grown_window(lattice, contact, field_space_t())
        self%first = larger%first
        self%extent = larger%extent
        if (product(self%extent) > largest_growth*most_nodes) self%verdict = failed
      else
        self%n_enlarged = self%n_enlarged + 1
        if (self%n_enlarged > most_enlargements) self%verdict = failed
        call self%put_around(2*self%spacing)
      end if
    else
      self%encloses = .true.
      call self%measure(lattice, pressure, contact)
      across = narrow_nodes*self%spacing*min(1.0_wp, self%cell_ratio)
      half_width = self%half_width(lattice%cell_area())
      refined = .false.
      if (half_width < across) call self%refine(across/half_width, refined)
      if (.not. refined) self%verdict = accepted
    end if
    if (self%verdict == pending .and. self%n_tried == most_trials) self%verdict = failed
  end subroutine judge

  !> Set the next lattice about the point, with as many nodes.
  pure subroutine put_around(self, spacing)
    class(contact_search_t), intent(inout) :: self
    !> Its spacing [m]
    real(wp), intent(in) :: spacing

    self%spacing = spacing
    self%first = ieee_rint(self%center/spacing) - floor_of(self%extent/2)
  end subroutine put_around

  !> Set the next lattice about the contact, finer by a whole factor, unless it has too many nodes.
  pure subroutine refine(self, wanted, refined)
    class(contact_search_t), intent(inout) :: self
    !> The factor at least, if it is not too large
    real(wp), intent(in) :: wanted
    !> The lattice is set
    logical, intent(out) :: refined
    real(wp) :: spacing, first(2), last(2)

    spacing = self%spacing/min(max(-floor_of(-wanted), least_factor), largest_factor)
    first = floor_of((self%lower - self%spacing)/spacing) - 1
    last = -floor_of(-(self%upper + self%spacing)/spacing) + 1
    refined = product(last - first + 1) <= most_nodes
    if (.not. refined) return
    self%spacing = spacing
    self%first = first
    self%extent = last - first + 1
  end subroutine refine

  !> Measure the contact on a lattice.
  pure subroutine measure(self, lattice, pressure, contact)
    class(contact_search_t), intent(inout) :: self
    type(lattice_t), intent(in) :: lattice
    !> Pressure (n_col, n_row) [Pa], and nodes in contact
    real(wp), intent(in) :: pressure(:, :)
    logical, intent(in) :: contact(:, :)
    real(wp), allocatable :: right(:), up(:)
    integer :: row, col, n

    self%n_contact = count(contact)
    allocate (right(self%n_contact), up(self%n_contact))
    n = 0
    do row = 1, size(contact, 2)
      do col = 1, size(contact, 1)
        if (.not. contact(col, row)) cycle
        n = n + 1
        associate (j => lattice%first + [col, row] - 1, basis => lattice%basis)
          right(n) = (lattice%origin(1) + j(2)*basis(1, 2)) + j(1)*basis(1, 1)
          up(n) = (lattice%origin(2) + j(2)*basis(2, 2)) + j(1)*basis(2, 1)
        end associate
      end do
    end do
    self%max_pressure = maxval(pressure)
    self%size = [maxval(right) - minval(right), maxval(up) - minval(up)] + self%spacing
    self%lower = (lattice%first - 1 + [findloc(any(contact, 2), .true., 1), findloc(any(contact, 1), .true., 1)])*self%spacing
    self%upper = (lattice%first - 1 + [findloc(any(contact, 2), .true., 1, back=.true.), &
                                       findloc(any(contact, 1), .true., 1, back=.true.)])*self%spacing
    right = right - sum_of(right)/n
    up = up - sum_of(up)/n
    self%moment = [sum_of(right*right), sum_of(up*up), sum_of(right*up)]/n
    self%breadth = breadth_of(lattice, contact)
  end subroutine measure

  !> Return twice the area of a contact over the length of its edge [m].
  !>
  !> Pairs of nodes on both sides of it along a direction give its length as seen from there, and the mean of three directions
  !> that of a curve of all directions.
  pure real(wp) function breadth_of(lattice, contact)
    type(lattice_t), intent(in) :: lattice
    !> Nodes in contact (n_col, n_row)
    logical, intent(in) :: contact(:, :)
    logical :: inside(0:size(contact, 1) + 1, 0:size(contact, 2) + 1)
    real(wp) :: seen

    inside = .false.
    inside(1:size(contact, 1), 1:size(contact, 2)) = contact
    associate (n => size(contact, 1), m => size(contact, 2), first => lattice%basis(:, 1), second => lattice%basis(:, 2))
      seen = count(inside(1:, :) .neqv. inside(:n, :))/norm2(first) + count(inside(:, 1:) .neqv. inside(:, :m))/norm2(second) &
             + count(inside(:n, 1:) .neqv. inside(1:, :m))/norm2(second - first)
    end associate
    breadth_of = 12.0_wp/pi*count(contact)/seen
  end function breadth_of

  !> Return the smaller semi-axis of the ellipse with the second moments of the nodes, and with the inertia of a cell itself [m].
  pure real(wp) function half_width(self, cell_area)
    class(contact_search_t), intent(in) :: self
    !> Area of a cell [m^2]
    real(wp), intent(in) :: cell_area

    associate (xx => self%moment(1), yy => self%moment(2), xy => self%moment(3))
      half_width = 2*sqrt(max((xx + yy)/2 - hypot((xx - yy)/2, xy) + cell_area/12, 0.0_wp))
    end associate
  end function half_width

  !> Return the largest whole number that is not above a number of any size.
  elemental real(wp) function floor_of(value)
    real(wp), intent(in) :: value

    floor_of = aint(value)
    if (floor_of > value) floor_of = floor_of - 1
  end function floor_of

  !> Return a sum by halves, whose rounding errors do not grow with their number.
  pure recursive real(wp) function sum_of(values) result(total)
    real(wp), intent(in) :: values(:)
    real(wp) :: lane(n_lane)
    integer :: n, i

    n = size(values)
    if (n > n_block) then
      i = n/2 - modulo(n/2, n_lane)
      total = sum_of(values(:i)) + sum_of(values(i + 1:))
      return
    end if
    total = 0.0_wp
    if (n >= n_lane) then
      lane = values(:n_lane)
      do i = n_lane + 1, n - modulo(n, n_lane), n_lane
        lane = lane + values(i:i + n_lane - 1)
      end do
      total = ((lane(1) + lane(2)) + (lane(3) + lane(4))) + ((lane(5) + lane(6)) + (lane(7) + lane(8)))
      n = modulo(n, n_lane)
    end if
    do i = size(values) - n + 1, size(values)
      total = total + values(i)
    end do
  end function sum_of

  !> Solve a frictionless problem roughly, in one thread; no pressure if no node can touch.
  subroutine find_rough_pressure(lattice, medium, law, gap, target, pressure, error, cache)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Law of contact
    class(normal_law_t), intent(in) :: law
    !> Gap before loading, infinite where nothing can touch (n_col, n_row) [m]
    real(wp), intent(in) :: gap(:, :)
    !> Load or approach
    type(load_target_t), intent(in) :: target
    !> Pressure (n_col, n_row) [Pa]
    real(wp), intent(out) :: pressure(:, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    type(normal_contact_t), allocatable, target :: contact
    type(contact_state_t) :: none, found
    logical :: candidate(size(gap, 1), size(gap, 2))
    real(wp) :: no_reference(0, 0, 0)

    pressure = 0.0_wp
    candidate = ieee_is_finite(gap)
    if (.not. any(candidate)) return
    call require_memory(normal_contact_memory(lattice%extent, 1, .false.), error, 1)
    if (allocated(error)) return
    allocate (contact)
    call new_normal_contact(contact, lattice, medium, merge(gap, 0.0_wp, candidate), candidate, error, 1, cache, law=law)
    if (.not. allocated(error)) call contact%solve_step(none, no_reference, target, roughly, max_sweeps, found, error)
    if (.not. allocated(error)) pressure = found%pressure
  end subroutine find_rough_pressure

end module hc_contact_search
